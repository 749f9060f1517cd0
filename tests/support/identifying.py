"""Records of known models of hysteresis, to identify them from."""

import dataclasses
import itertools

import numpy as np
import pytest

from twin.signals.excitation import SIGNALS, command

OTHER = (0.4, 35.0, 21.0)
SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))]
TIME = np.arange(300) * 0.1  # [s]


def records_of(parameters, noise_deg: float = 0.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Two strokes, by a loop over eq. 4 independent of the module. Noise spares the first sample."""
    a, b, c = parameters
    rng = np.random.default_rng(8)
    records = []
    for amplitude, period in ((1.0, 10.0), (0.5, 7.0)):
        pull = 3 + amplitude * np.sin(2 * np.pi * TIME / period)
        bend = [60.0]
        for before, now in itertools.pairwise(pull):
            bend.append(bend[-1] + a * abs(now - before) * (b * now - bend[-1]) + c * (now - before))
        noise = noise_deg * rng.standard_normal(len(pull))
        noise[0] = 0
        records.append((pull, np.array(bend) + noise))
    return records


def noisy_records(model, seed: int, stroke=(2.0, 4.0), each: int = 1) -> list[tuple[np.ndarray, np.ndarray]]:
    """Records of 60 s of every signal, reached from rest at zero, with the training noise R = 0.1 deg^2."""
    rng = np.random.default_rng(seed)
    low, high = (edge * 1e-3 for edge in stroke)
    records = []
    for kind in list(SIGNALS) * each:
        pull = command(kind, (low, high), 60.0, 0.1, rng) * 1e3
        approach = np.linspace(0, pull[0], 100)
        bend = model.response(np.concatenate([approach, pull]), 0.0)[100:]
        records.append((pull, bend + np.sqrt(0.1) * rng.standard_normal(600)))
    return records


def parameters_of(model) -> np.ndarray:
    return np.array(dataclasses.astuple(model))
