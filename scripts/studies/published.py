"""Published figures of an instrument, as they come out in a twin: a Coleman-Hodgdon model, a filter's errors.

Both are made as `endotwin generate`, `identify` and `evaluate` make them, on several draws of the excitation,
for many endoscopes at once; so is the roundness of the tip's path along a circle of commands.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.evaluation.protocol import STEADY_SECONDS, Protocol
from twin.hysteresis import ColemanHodgdon
from twin.mechanics.kinematics import link_frames
from twin.preset.preset import Preset
from twin.reduced import simulate_batch
from twin.signals.excitation import SIGNALS, command
from twin.signals.noise import draw_noise, noise_variance

Array = NDArray[np.float64]

FINE = 0.02  # of the commands that `generate` draws [s]
DRAWS = 3  # of each noise
PERIOD, TURNS, STEP = 16.0, 2.25, 0.05  # of a circle [s], number of turns, sample time [s]
SAMPLE_TIME, WRONG_START = Protocol.sample_time_s, Protocol.initial_error_deg  # [s], [deg]


@dataclasses.dataclass(frozen=True)
class Published:
    """Published figures of an instrument."""

    model: tuple[float, float, float]  # a [1/mm], b [deg/mm], c [deg/mm]
    # RMSE of AM [deg] by kind and level of the noise, each with the share that it may be off by
    active: Mapping[tuple[str, float], tuple[float, float]]
    static: tuple[float, float]  # lowest and highest RMSE of C-H [deg]
    misfit: float  # most RMSE of C-H where it was identified [deg]
    steady: float  # most RMSE of C-H on the other stroke, once the start is forgotten [deg]
    # most departure of the tip from a circle, as a share of its radius, where a circle of commands is asked
    # for: no figure of the instrument, but of any with two like planes
    round_within: float = np.inf


@dataclasses.dataclass(frozen=True)
class Commands:
    """Commands of all excitation seeds [m]: S seeds, E episodes each, N samples."""

    identified: Array  # (S, E, N), on the stroke of the identification
    tested: Array  # (S, E, N), on the stroke of the test; their E may be another one

    @classmethod
    def drawn(
        cls,
        seeds: Sequence[int],
        *,
        strokes: Sequence[tuple[float, float]],
        episodes: tuple[int, int],
        seconds: float,
    ) -> "Commands":
        """Draw the commands of `generate`, tests with the seed that follows; kinds of signals take turns.

        `strokes` [m] and numbers of episodes of a seed are those of identification and test.
        """
        kinds, every = list(SIGNALS), round(SAMPLE_TIME / FINE)

        def drawn(which: int, seed: int) -> list[Array]:
            streams = [np.random.SeedSequence([seed, k]).spawn(1)[0] for k in range(episodes[which])]
            rngs = map(np.random.default_rng, streams)
            return [
                command(kinds[k % len(kinds)], strokes[which], seconds, FINE, rng)[::every]
                for k, rng in enumerate(rngs)
            ]

        return cls(*(np.array([drawn(which, seed + which) for seed in seeds]) for which in (0, 1)))


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Published figures as an endoscope has them, by excitation seed."""

    model: Array  # (S, 3) a [1/mm], b [deg/mm], c [deg/mm]
    misfit: Array  # (S,) RMSE of C-H where it was identified [deg]
    static: Array  # (S,) RMSE of C-H on the other stroke, from a wrong start [deg]
    steady: Array  # (S,) RMSE of C-H on the other stroke after the start, from a right one [deg]
    active: Array  # (S, rows) RMSE of AM [deg]


def best_coleman_hodgdon(pull_mm: Array, bend_deg: Array) -> tuple[Array, Array]:
    """Fit a Coleman-Hodgdon model to each of many groups of records, (G, E, N) [mm] and [deg].

    For a given a the response is linear in b and c (variable projection, Golub and Pereyra 1973), so that the
    search is along one line, by golden sections of log a in all groups at once. Returns (G, 3) a [1/mm],
    b [deg/mm], c [deg/mm], and (G,) RMSE [deg].
    """
    parts = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:, :, None, None]  # b and c of: start, b, c
    starts = np.array([1.0, 0.0, 0.0])[:, None, None] * bend_deg[:, :, 0]

    def project(logarithm: Array) -> tuple[Array, Array]:
        a = np.exp(logarithm)
        free, of_b, of_c = ColemanHodgdon(a[:, None], *parts).response(pull_mm, starts)
        matrix = np.stack([of_b, of_c], axis=-1).reshape(len(a), -1, 2)
        target = (bend_deg - free).reshape(len(a), -1, 1)
        square = matrix.transpose(0, 2, 1)
        slopes = np.linalg.solve(square @ matrix, square @ target)
        off = np.sqrt(np.mean((target - matrix @ slopes) ** 2, axis=(1, 2)))
        return np.column_stack([a, slopes[..., 0]]), off

    shrink = (5**0.5 - 1) / 2
    low, high = (np.full(len(pull_mm), np.log(end)) for end in (0.05, 6.0))
    inner = [high - shrink * (high - low), low + shrink * (high - low)]
    off = [project(place)[1] for place in inner]
    while (high - low).max() > 1e-4:
        left = off[0] < off[1]
        low, high = np.where(left, low, inner[0]), np.where(left, inner[1], high)
        place = np.where(left, high - shrink * (high - low), low + shrink * (high - low))
        kept, its_off = np.where(left, inner[0], inner[1]), np.where(left, off[0], off[1])
        found = project(place)[1]
        inner = [np.where(left, place, kept), np.where(left, kept, place)]
        off = [np.where(left, found, its_off), np.where(left, its_off, found)]
    return project((low + high) / 2)


def outcomes(
    presets: Sequence[Preset], commands: Commands, noises: Sequence[tuple[str, float]]
) -> list[Outcome | None]:
    """Return what the published figures are in each endoscope; None of one without equilibrium."""
    sets = (commands.identified, commands.tested)
    runs = [pull for commanded in sets for pull in commanded.reshape(-1, commanded.shape[-1])]
    episodes = simulate_batch([p for p in presets for _ in runs], runs * len(presets), SAMPLE_TIME)
    groups = [episodes[first : first + len(runs)] for first in range(0, len(episodes), len(runs))]
    able = [number for number, group in enumerate(groups) if all(e is not None for e in group)]
    results: list[Outcome | None] = [None] * len(presets)
    if not able:
        return results

    def gathered(field: str) -> list[Array]:
        """Return one signal of both sets, (endoscopes and seeds, episodes, N) each."""
        whole = np.array([[getattr(e, field) for e in groups[number]] for number in able])
        parts = np.split(whole, [commands.identified[..., 0].size], axis=1)
        return [part.reshape(-1, *one.shape[1:]) for part, one in zip(parts, sets, strict=True)]

    pull, bend = gathered("pull_mm"), gathered("truth_deg")
    model, misfit = best_coleman_hodgdon(pull[0], bend[0])
    static, steady, active = _errors(model, pull[1], bend[1], noises)
    seeds = len(commands.identified)
    for place, number in enumerate(able):
        own = slice(place * seeds, (place + 1) * seeds)
        results[number] = Outcome(model[own], misfit[own], static[own], steady[own], active[own])
    return results


def _errors(
    model: Array, pull: Array, bend: Array, noises: Sequence[tuple[str, float]]
) -> tuple[Array, Array, Array]:
    """Return RMSE [deg] of C-H and, once the start is forgotten, of C-H, (G,), and of AM, (G, noises)."""
    after = round(STEADY_SECONDS / SAMPLE_TIME)
    a_b_c = [numbers[:, None] for numbers in model.T]
    of_model = ColemanHodgdon(*a_b_c)
    off = of_model.response(pull, bend[..., 0]) - bend
    steady = np.sqrt(np.mean(off[..., after:] ** 2, axis=(1, 2)))
    off = of_model.response(pull, bend[..., 0] + WRONG_START) - bend
    static = np.sqrt(np.mean(off[..., 1:] ** 2, axis=(1, 2)))

    shape = (len(noises), DRAWS, *bend.shape)  # one filter for each, in one pass
    noise = np.empty(shape)
    for row, (kind, level) in enumerate(noises):  # the same draws for every candidate
        drawn = draw_noise(kind, level, (DRAWS, *bend.shape[1:]), np.random.default_rng(row))
        noise[row] = drawn[:, None]
    variance = np.array([noise_variance(kind, level) for kind, level in noises])[:, None, None, None]
    each = [np.broadcast_to(number, shape[:-1]).ravel() for number in (*a_b_c, variance)]
    filters = ActiveModel(ColemanHodgdon(*each[:3]), SAMPLE_TIME, measurement_variance=each[3])
    measured = (bend + noise).reshape(-1, shape[-1])
    pulls, start = np.broadcast_to(pull, shape).reshape(measured.shape), bend[..., 0] + WRONG_START
    starts = np.broadcast_to(start, shape[:-1]).ravel()
    off = filters.estimate(pulls, measured, starts).reshape(shape) - bend
    return static, steady, np.sqrt(np.mean(off[..., 1:] ** 2, axis=(1, 3, 4))).T


def out_of_round(presets: Sequence[Preset], radii: Sequence[float]) -> Array:
    """Return how far the tip's path, seen along the shaft, is from a circle, as a share of its radius.

    (B, radii) of B endoscopes, whose second plane is like the first, and circles of commands of these radii
    [m]; infinity where the tip stays, or has no equilibrium.
    """
    angle = 0.3 + 2 * np.pi * np.arange(0, TURNS * PERIOD, STEP) / PERIOD
    two = [
        p.replace(bending_planes=2, lateral_initial_bend=p.initial_bend, lateral_command_zero=p.command_zero)
        for p in presets
    ]
    episodes = simulate_batch(
        [preset for preset in two for _ in radii],
        [radius * np.cos(angle) for radius in radii] * len(two),
        STEP,
        lateral_pulls=[radius * np.sin(angle) for radius in radii] * len(two),
    )
    shares, turn = np.full(len(episodes), np.inf), slice(-round(PERIOD / STEP), None)
    for number, episode in enumerate(episodes):
        if episode is not None:
            angles = episode.joint_angle[turn], episode.lateral_joint_angle[turn]
            tip = link_frames(*angles, two[number // len(radii)].section_length).position[:, -1]
            reach = np.hypot(*(tip - tip.mean(axis=0)).T[1:])
            shares[number] = np.abs(reach / reach.mean() - 1).max() if reach.any() else np.inf
    return shares.reshape(len(two), len(radii))
