"""EndoTwin: a digital twin of a tendon-driven flexible endoscope, its datasets and estimators of its bending.

What a notebook needs is here, and is loaded when it is first used:

```
import numpy as np
import twin

preset = twin.load_preset("ureteroscope")
pull = 3e-3 + 1e-3 * np.sin(np.arange(0, 60, 0.02))  # metres
episode = twin.simulate(preset, pull, sample_time=0.02)
twin.render(episode, "bend.png")
```
"""

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "ActiveModel": "twin.estimation.active_model",
    "ColemanHodgdon": "twin.hysteresis",
    "Dataset": "twin.episode",
    "EndoTwinError": "twin.errors",
    "Endoscope": "twin.physics",
    "Episode": "twin.episode",
    "OnlineEstimator": "twin.live.online",
    "Preset": "twin.preset",
    "Recipe": "twin.dataset.recipe",
    "ReducedTwins": "twin.reduced",
    "Sensor": "twin.estimation.estimator",
    "at_fidelity": "twin.preset",
    "error_indices": "twin.evaluation.metrics",
    "evaluate": "twin.evaluation.compare",
    "identify": "twin.identification",
    "load_estimator": "twin.estimation.load",
    "load_model": "twin.hysteresis",
    "load_preset": "twin.preset",
    "load_recipe": "twin.dataset.recipe_file",
    "method_specs": "twin.estimation.registry",
    "preset_names": "twin.preset",
    "read_dataset": "twin.recording",
    "read_episode": "twin.recording",
    "read_pictures": "twin.recording.camera",
    "recover_episode": "twin.recording",
    "render": "twin.rendering.render",
    "simulate": "twin.simulation",
    "simulate_batch": "twin.simulation",
    "write_dataset": "twin.dataset.write",
    "write_episode": "twin.recording",
}
"""Module that each public name is loaded from. A new name gets a line here and one below."""

if TYPE_CHECKING:  # the same for type checkers and editors
    from twin.dataset.recipe import Recipe as Recipe
    from twin.dataset.recipe_file import load_recipe as load_recipe
    from twin.dataset.write import write_dataset as write_dataset
    from twin.episode import Dataset as Dataset
    from twin.episode import Episode as Episode
    from twin.errors import EndoTwinError as EndoTwinError
    from twin.estimation.active_model import ActiveModel as ActiveModel
    from twin.estimation.estimator import Sensor as Sensor
    from twin.estimation.load import load_estimator as load_estimator
    from twin.estimation.registry import method_specs as method_specs
    from twin.evaluation.compare import evaluate as evaluate
    from twin.evaluation.metrics import error_indices as error_indices
    from twin.hysteresis import ColemanHodgdon as ColemanHodgdon
    from twin.hysteresis import load_model as load_model
    from twin.identification import identify as identify
    from twin.live.online import OnlineEstimator as OnlineEstimator
    from twin.physics import Endoscope as Endoscope
    from twin.preset import Preset as Preset
    from twin.preset import at_fidelity as at_fidelity
    from twin.preset import load_preset as load_preset
    from twin.preset import preset_names as preset_names
    from twin.recording import read_dataset as read_dataset
    from twin.recording import read_episode as read_episode
    from twin.recording import recover_episode as recover_episode
    from twin.recording import write_episode as write_episode
    from twin.recording.camera import read_pictures as read_pictures
    from twin.reduced import ReducedTwins as ReducedTwins
    from twin.rendering.render import render as render
    from twin.simulation import simulate as simulate
    from twin.simulation import simulate_batch as simulate_batch
else:

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first used (PEP 562)."""
        if name not in _HOME:
            raise AttributeError(f"module 'twin' has no attribute {name!r}; it has {', '.join(_HOME)}")
        from twin.errors import needs_extra

        with needs_extra(f"twin.{name}"):
            value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value


__all__ = list(_HOME)


_NEEDS = {
    "twin.physics": "mujoco",
    "twin.rendering.render": "mujoco",
    "twin.dataset.write": "mujoco",
    "twin.identification": "pymoo",
}
"""Package that a home cannot be loaded without."""


def __dir__() -> list[str]:
    """Return the names that can be loaded with what is installed: `help(twin)` loads all of them."""
    absent = {home for home, package in _NEEDS.items() if importlib.util.find_spec(package) is None}
    there = [name for name, home in _HOME.items() if home not in absent]
    return sorted([*there, "__doc__", "__version__"])
