"""The ground in front of a camera: from pixels to metres and back."""
