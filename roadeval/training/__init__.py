"""How a pipeline learns: which frames, which pixels, what is fitted, and the model file.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.training.learning import TrainingError, fit
    from roadeval.training.model import Model, load_model, save_model
    from roadeval.training.settings import TrainingSettings

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
