"""How a pipeline learns: which frames, which pixels, what is fitted, and the model file."""

from roadeval.training.fitting import TrainingError, fit
from roadeval.training.model import Model, load_model, save_model
from roadeval.training.settings import TrainingSettings

__all__ = [
    "Model",
    "TrainingError",
    "TrainingSettings",
    "fit",
    "load_model",
    "save_model",
]
