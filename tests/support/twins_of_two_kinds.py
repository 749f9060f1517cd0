"""Angles of an ensemble that is no normal law: of slow twins and of quick ones."""

import numpy as np

SAMPLES = 60


def family(count, seed):
    """Angles of members that are no normal law: of slow and of quick ones."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / 10
    rate = rng.choice([0.3, 1.0], count) * rng.uniform(0.9, 1.1, count)
    size = rng.uniform(5, 15, count)
    return size[:, None] * (1 - np.exp(-rate[:, None] * time))


def last_state(filter_, measured):
    """State of a filter after measurements (B, N)."""
    pull = np.zeros(len(measured))
    state = filter_.start(pull, pull)
    for of_sample in measured.T[1:]:
        state = filter_.step(state, pull, pull, of_sample)
    return state


def estimates(filter_, measured):
    return filter_.estimate_with_interval(np.zeros(measured.shape), measured, 0.0)
