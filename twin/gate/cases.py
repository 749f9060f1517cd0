"""Runs of the gate: held-out twins of a preset along commands of several strokes, under several noises.

Everything is drawn from a stream of random numbers that no training has: its seed begins with a number of the
gate's own.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Case
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import simulate_batch
from twin.signals.excitation import SIGNALS, command
from twin.signals.noise import draw_noise, noise_bound, noise_variance

Array = NDArray[np.float64]
Condition = tuple[str, float]
"""Kind and level of a noise."""

STREAM = 0x656E646F7477696E  # of the gate alone: seeds of trainings are small numbers, and differ in length
NOISES: tuple[Condition, ...] = (
    ("gaussian", 1.0),
    ("laplace", 1.0),
    ("uniform", 1.0),
    ("gamma", 1.0),
    ("poisson-dithered", 1.0),
    ("salt-and-pepper", 0.05),
)
ZERO_MEAN = ("gaussian", "laplace", "uniform", "salt-and-pepper")
INITIAL_ERROR_DEG = 20.0
MOVING = 3  # one twin in so many has its sheath bent on meanwhile
SPARE = 1  # twins beyond those asked for: one drawn from wide ranges may find no equilibrium


class Runs(NamedTuple):
    """C commands and K twins along each, of equal length.

    Attributes:
        pull_mm: (C, N) command [mm].
        bend_deg: (C, K, N) true angle [deg].
        strokes_mm: of each command [mm].
        left_out: twins that found no equilibrium, or were not needed in place of one.
    """

    pull_mm: Array
    bend_deg: Array
    strokes_mm: tuple[tuple[float, float], ...]
    left_out: int = 0


def stream(seed: int, purpose: int) -> np.random.Generator:
    """Return the random numbers of one purpose of the gate; no training draws from them."""
    return np.random.default_rng(np.random.SeedSequence([STREAM, seed]).spawn(purpose + 1)[purpose])


def strokes_within(stroke_mm: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """Return three strokes of a reach: a quarter in its middle, its upper quarter, and all of it [mm]."""
    low, high = stroke_mm
    middle, width = (low + high) / 2, high - low
    return ((middle - width / 8, middle + width / 8), (high - width / 4, high), (low, high))


def draw_commands(
    stroke_mm: tuple[float, float], seconds: float, sample_time: float, kinds: int, rng: np.random.Generator
) -> tuple[list[Array], tuple[tuple[float, float], ...]]:
    """Return commands [m], `kinds` kinds of signal on each stroke, and the stroke of each [mm]."""
    pulls, strokes = [], []
    for number, (low, high) in enumerate(strokes_within(stroke_mm)):
        names = list(SIGNALS)
        for place in range(kinds):
            name = names[(number + place) % len(names)]
            pulls.append(command(name, (low * 1e-3, high * 1e-3), seconds, sample_time, rng))
            strokes.append((low, high))
    return pulls, tuple(strokes)


def simulate_runs(
    preset: Preset,
    ranges: Ranges | None,
    pulls: Sequence[Array],
    strokes_mm: tuple[tuple[float, float], ...],
    twins: int,
    sample_time: float,
    rng: np.random.Generator,
    on_progress: Callable[[int, int], None] | None = None,
) -> Runs:
    """Simulate twins along commands by the reduced twin.

    Args:
        preset: the endoscope.
        ranges: what twins are drawn from; the preset itself, if None.
        pulls: (N,) commands [m].
        strokes_mm: of each.
        twins: K along each.
        sample_time: T [s].
        rng: of the draws.
        on_progress: told how many of how many samples are done.

    Raises:
        FloatingPointError: too many twins found no equilibrium.
    """
    spare = 0 if ranges is None else SPARE
    presets: list[Preset] = []
    along: list[Array] = []
    bends: list[Array | None] = []
    moves = ranges is not None and any(name == "sheath_bend" for name, _, _ in ranges.limits)
    for number, pull in enumerate(pulls):
        for place in range(twins + spare):
            drawn = preset if ranges is None else ranges.draw(preset, rng)
            presets.append(drawn)
            along.append(pull)
            moving = ranges is not None and moves and (number + place) % MOVING == 0
            end = ranges.draw(preset, rng).sheath_bend if ranges is not None and moving else drawn.sheath_bend
            bends.append(np.linspace(drawn.sheath_bend, end, len(pull)) if moving else None)
    episodes = simulate_batch(presets, along, sample_time, sheath_bends=bends, on_sample=on_progress)
    found = []
    for number in range(len(pulls)):
        mine = episodes[number * (twins + spare) : (number + 1) * (twins + spare)]
        whole = [episode.truth_deg for episode in mine if episode is not None]
        if len(whole) < twins:
            raise DivergedError(f"twins along command {number + 1} of the gate found no equilibrium")
        found.append(whole[:twins])
    left_out = sum(episode is None for episode in episodes)
    return Runs(np.array(pulls) * 1e3, np.array(found), strokes_mm, left_out)


def noisy(runs: Runs, condition: Condition, draws: int, rng: np.random.Generator) -> Case:
    """Return C K D runs under one noise, ordered by command, twin and draw; the truth is with them."""
    kind, level = condition
    commands, twins, samples = runs.bend_deg.shape
    truth = np.repeat(runs.bend_deg.reshape(commands * twins, samples), draws, axis=0)
    measured = truth + draw_noise(kind, level, truth.shape, rng)
    off = rng.uniform(-INITIAL_ERROR_DEG, INITIAL_ERROR_DEG, len(truth))
    count = len(truth)
    return Case(
        pull_mm=np.repeat(runs.pull_mm, twins * draws, axis=0),
        measurement_deg=measured,
        initial_bend_deg=truth[:, 0] + off,
        sensor=Sensor(np.full(count, noise_variance(kind, level)), np.full(count, noise_bound(kind, level))),
        noises=(condition,) * count,
        truth_deg=truth,
    )
