"""How a pipeline learns: its training frames and pixels, the fit, and the model file."""
