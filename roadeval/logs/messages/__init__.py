"""Camera messages and the pictures in them."""
