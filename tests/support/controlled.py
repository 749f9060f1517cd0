"""Knowledge of controllers of the ureteroscope before a run, and a loop around any plant."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from twin.control.controller import CommandLimits, ControlKnowledge, Controller, Sensed
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.hysteresis import ColemanHodgdon
from twin.preset.file import load_preset

T = 0.1
R = 0.1
PRESET = load_preset("ureteroscope")
STROKE_MM = (-3.0, 3.0)
LIMITS = CommandLimits(-3.5, 3.5, 8.0)
MODEL = ColemanHodgdon(1.33, 22.3, 3.4)
"""As identified on the ureteroscope."""
FALLBACK = ActiveModel(MODEL, T, (0.1, 0.8), R, (100.0, 1.0))
DEPLOYMENT = Deployment(FALLBACK, (-4.8, 4.8), (-93.0, 93.0), 10.0, 300.0)


def knowledge(**changes: Any) -> ControlKnowledge:
    """Return what is known of the nominal endoscope, with some of it changed."""
    known = {
        "preset": PRESET,
        "stroke_mm": STROKE_MM,
        "limits": LIMITS,
        "sample_time": T,
        "noise_variance": R,
        "deployment": DEPLOYMENT,
    }
    return ControlKnowledge(**known | changes)


class Course(NamedTuple):
    """Course of a loop, N samples: the pull that acts at each, the bend there, and who is in charge."""

    pull_mm: np.ndarray
    bend_deg: np.ndarray
    believed_deg: np.ndarray
    fell_back: np.ndarray


def closed_loop(
    controller: Controller,
    plant: Callable[[float], float],
    wanted_deg: np.ndarray,
    seen: Callable[[int, float], float] = lambda sample, bend: bend,
    first_mm: float = 0.0,
    preview: int = 0,
) -> Course:
    """Run a controller on any plant, from a pull to its bend; `seen` makes the measurement of it."""
    controller.start(first_mm, float(wanted_deg[0]))
    pull, rows = first_mm, []
    for k, wanted in enumerate(wanted_deg):
        bend = plant(pull)
        following = wanted_deg[min(k + 1, len(wanted_deg) - 1)]
        known = float(wanted), float(following), wanted_deg[k + 1 : k + 1 + preview]
        sensed = Sensed(k * controller.sample_time, float(seen(k, bend)), *known)
        command = controller.step(sensed)
        rows.append((pull, bend, controller.estimate_deg, controller.falls_back))
        pull = command
    return Course(*np.array(rows).T)


def assert_within(limits: CommandLimits, pull_mm: np.ndarray, sample_time: float = T) -> None:
    """Every command is a number on the stroke, no faster than the limit."""
    assert all(math.isfinite(pull) for pull in pull_mm)
    assert limits.low_mm <= np.min(pull_mm)
    assert np.max(pull_mm) <= limits.high_mm
    rounding = 4 * np.spacing(max(abs(limits.low_mm), abs(limits.high_mm)))
    assert np.abs(np.diff(pull_mm)).max(initial=0.0) <= limits.speed_mm_s * sample_time + rounding
