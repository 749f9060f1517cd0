"""Systems that a model describes up to an error within bounds, for what holds whatever the error is."""

import numpy as np
from models import BOUC_WEN, COLEMAN_HODGDON

from twin.estimation.set_membership import ErrorBound
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

T = 0.1  # [s]
MODELS = [COLEMAN_HODGDON, BOUC_WEN, PrandtlIshlinskii([2.0, 5.0, 9.0], [0.0, 0.2, 0.6])]
BATCH, SAMPLES = 40, 120


def pulls(rng: np.random.Generator, count: int = BATCH, samples: int = SAMPLES) -> np.ndarray:
    """Commands (B, N) of random frequencies and roughness, with rests [mm]."""
    time = np.arange(samples) * T
    smooth = np.sin(2 * np.pi * time / rng.uniform(2, 20, (count, 1)) + rng.uniform(0, 6, (count, 1)))
    rough = np.cumsum(rng.normal(0, 0.05, (count, samples)), axis=1)
    pull = 3 + smooth + rough * (rng.random((count, 1)) < 0.5)
    pull[:, 50:60] = pull[:, 50:51]
    return pull


def bounded(rng: np.random.Generator, shape: tuple[int, ...], style: str) -> np.ndarray:
    """Numbers in [-1, 1]: even, at the ends, or one sided for long."""
    even = rng.uniform(-1, 1, shape)
    return {"even": even, "ends": np.sign(even), "one sided": np.sign(even[:1]) * np.ones(shape)}[style]


def simulate(model, bound: ErrorBound, pull: np.ndarray, rng: np.random.Generator, style: str):
    """Angles (B, N) of a system that keeps within its bounds."""
    count, samples = pull.shape
    bend = np.empty(pull.shape)
    bend[:, 0] = rng.uniform(20, 100, count)
    memory = model.start(pull[:, 0])
    for k in range(1, samples):
        stepped, memory = model.step(bend[:, k - 1], memory, pull[:, k], pull[:, k - 1])
        reach = bound.slope_deg_per_mm * np.abs(pull[:, k] - pull[:, k - 1]) + bound.floor_deg
        bend[:, k] = stepped + reach * bounded(rng, (count,), style)
    return bend
