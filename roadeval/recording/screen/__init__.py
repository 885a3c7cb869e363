"""What the viewer shows: its arrangement, texts and colours; and the viewer itself."""
