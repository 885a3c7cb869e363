"""Reading a recording back."""
