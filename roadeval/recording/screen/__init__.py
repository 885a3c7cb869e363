"""The viewer: its arrangement, texts and colours, and how it is opened."""
