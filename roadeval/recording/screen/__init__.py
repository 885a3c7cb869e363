"""What the viewer shows: layout, words, colours."""
