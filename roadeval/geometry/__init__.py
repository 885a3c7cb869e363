"""The ground in front of a camera: pixels to metres and back."""
