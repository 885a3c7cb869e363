"""How a pipeline learns: which frames, which pixels, what is fitted, and the model file."""
