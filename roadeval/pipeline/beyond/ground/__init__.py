"""Features of a pixel of the ground, one idea a file: those that define ``GROUP`` are found."""
