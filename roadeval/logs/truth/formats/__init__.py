"""Label formats: files in which annotation tools keep shapes, a module for each."""
