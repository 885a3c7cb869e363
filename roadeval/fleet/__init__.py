"""Many drives: how they are found, where their files are, and which workers replay them."""
