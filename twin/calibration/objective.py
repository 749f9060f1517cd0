"""Residuals of candidate presets against logs: all candidates times all logs in one batch simulation."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.logs import MeasuredLoop, windows_of_files
from twin.calibration.parameters import FreeParameters
from twin.episode import Episode
from twin.preset.preset import Preset
from twin.simulation import simulate_batch

Array = NDArray[np.float64]

BEND_SCALE = np.radians(1.0)  # error of the angle that costs 1 [rad]
TENSION_SHARE = 0.1  # of their range: both tensions off by this cost 1 together
PRIOR = 0.12  # cost of a parameter at one usual distance from the first guess, as an error of the angle [deg]
COMMON_COST = 0.25  # of a fit: where less is left unexplained, the first guess counts less
OFFSET_SPREAD = np.radians(2.0)  # usual offset of an angle whose zero is not known [rad]
_HOPELESS = 1e3  # residual of a candidate whose simulation failed


def predict(
    presets: Sequence[Preset], loops: Sequence[MeasuredLoop], physics: str = "mujoco", threads: int = 0
) -> list[list[Episode | None]]:
    """Simulate every candidate along every log; returns (candidates, logs), None where one failed.

    The wires are wound up in the sheath as it is bent in that log. Angles are as the sensor reads them,
    without its noise.
    """
    pairs = [(in_its_sheath(preset, loop), loop) for preset in presets for loop in loops]
    logs = [loop.episode for _, loop in pairs]
    episodes = simulate_batch(
        [preset for preset, _ in pairs],
        [log.pull for log in logs],
        loops[0].sample_time,
        lateral_pulls=[log.lateral_pull if log.lateral_pull.size else None for log in logs],
        physics=physics,
        threads=threads,
    )
    read = [as_read(*pair) for pair in zip(episodes, (preset for preset, _ in pairs), strict=True)]
    count = len(loops)
    return [read[start : start + count] for start in range(0, len(pairs), count)]


def in_its_sheath(preset: Preset, loop: MeasuredLoop) -> Preset:
    """Return a preset with the sheath bent as in a log, if that states it."""
    return preset if loop.sheath_bend is None else preset.replace(sheath_bend=loop.sheath_bend)


def as_read(episode: Episode | None, preset: Preset) -> Episode | None:
    """Return an episode with its angles as a sensor reads them, whose zero is that of the first plane."""
    lag, scale, zero = preset.sensor_latency, preset.sensor_scale, preset.sensor_zero
    if episode is None or (lag == 0 and scale == 1 and zero == 0):
        return episode
    bend, lateral = (
        scale * np.interp(episode.time - lag, episode.time, angle) if angle.size else angle
        for angle in (episode.bend, episode.lateral_bend)
    )
    return dataclasses.replace(episode, bend=bend + zero, lateral_bend=lateral)


def residuals(
    presets: Sequence[Preset],
    loops: Sequence[MeasuredLoop],
    physics: str = "mujoco",
    threads: int = 0,
    *,
    weight: float = 0.0,
) -> Array:
    """Return the weighted residuals of candidates against logs.

    Each log weighs the same: its squared differences are divided by its number of samples. An angle whose
    zero is not known (`MeasuredLoop.offset`) is compared less its mean difference, the best offset; a large
    one costs a little. Windows of one file were measured by one sensor: what their offsets have in common is
    an error like any other.

    Returns:
        (candidates, R); the sum of squares of a row is the cost of that candidate.
    """
    return np.array(
        [_all_residuals(episodes, loops, weight) for episodes in predict(presets, loops, physics, threads)]
    )


def penalised(
    free: FreeParameters,
    points: Sequence[Array],
    loops: Sequence[MeasuredLoop],
    physics: str,
    weight: float,
    threads: int = 0,
) -> Array:
    """Return the residuals of points (P,) of the search space, and their `departure` (points, R + P).

    Without it, parameters that the logs hardly determine would run to their limits and predict badly.
    """
    presets = [free.decode(numbers) for numbers in points]
    off = residuals(presets, loops, physics, threads, weight=weight)
    return np.hstack([off, departure(free, np.array(points), weight)])


def departure(free: FreeParameters, points: Array, weight: float) -> Array:
    """Return the departures of points (..., P) from the first guess, as residuals (..., P)."""
    return weight * (points - free.start) / free.spread


def scales_of(loop: MeasuredLoop) -> Array:
    """Return the scale of each channel of a log, of its angles and then of its tensions (C,) [rad, N]."""
    if loop.scales.size:
        return loop.scales
    force = np.sqrt(2) * TENSION_SHARE * (np.ptp(loop.tension) if loop.tension.size else 0.0)
    return np.array([BEND_SCALE] * loop.planes + [force] * loop.tension.shape[1])


def channels(loops: Sequence[MeasuredLoop]) -> list[list[slice]]:
    """Return where the residuals of each channel of each log are, in the order of `scales_of`."""
    places, begin = [], 0
    for loop in loops:
        count = np.count_nonzero(loop.fitted)
        ends = begin + count * np.arange(loop.planes + loop.tension.shape[1] + 1)
        places.append([slice(int(one), int(other)) for one, other in itertools.pairwise(ends)])
        begin = int(ends[-1]) + loop.planes  # of the offsets
    return places


def prior_weight(cost: float, loops: Sequence[MeasuredLoop]) -> float:
    """Return the weight of the first guess for a fit of this cost: `PRIOR` at most.

    A cost that noise explains gives the least weight: that of a prior next to the likelihood.
    """
    noise = float(sum(loop.noise.sum() for loop in loops) / BEND_SCALE**2)
    unexplained = max(cost - noise, 0.0)
    samples = sum(np.count_nonzero(loop.fitted) for loop in loops)
    least = math.sqrt(noise / max(int(samples), 1))
    return min(PRIOR, max(PRIOR * (unexplained / COMMON_COST) ** 2, least))


def bend_errors(episode: Episode | None, loop: MeasuredLoop) -> list[Array]:
    """Return how far the simulated bend is above the measured one in each plane, (N,) [rad]."""
    if episode is None:
        return []
    pairs = [(episode.bend, loop.episode.bend), (episode.lateral_bend, loop.episode.lateral_bend)]
    return [simulated - measured for simulated, measured in pairs if measured.size]


def offset_of(error: Array, loop: MeasuredLoop) -> float:
    """Return the offset of an angle that explains an error (N,) best [rad]; 0 where its zero is known.

    It is that of the fitted samples, or of all measured ones if none is fitted; each plane has its own.
    """
    scored = loop.fitted if loop.fitted.any() else loop.seen
    return float(error[scored].mean()) if loop.offset else 0.0


def offsets_taken_off(errors: Sequence[Sequence[Array]], loops: Sequence[MeasuredLoop]) -> list[Array]:
    """Return the offsets that fitted logs are compared less, (planes,) for each log [rad].

    Errors are those of each plane of each log (N,) [rad], none where it could not be simulated. Nothing is
    taken off a log that is only predicted.
    """
    offsets = [
        np.array([offset_of(error, loop) for error in of_log]) if of_log and loop.fitted.any() else None
        for of_log, loop in zip(errors, loops, strict=True)
    ]
    return [
        np.zeros(loop.planes) if offset is None else offset - shared
        for loop, offset, shared in zip(loops, offsets, shared_offsets(offsets, loops), strict=True)
    ]


def own_offsets(episodes: Sequence[Episode | None], loops: Sequence[MeasuredLoop]) -> Array:
    """Return the offset in the first plane of each fitted log whose zero is not known, (L,) [rad]."""
    errors = [bend_errors(episode, loop) for episode, loop in zip(episodes, loops, strict=True)]
    of_logs = zip(offsets_taken_off(errors, loops), loops, strict=True)
    return np.array([float(off[0]) for off, loop in of_logs if loop.offset and loop.fitted.any()])


def shared_offsets(offsets: Sequence[Array | None], loops: Sequence[MeasuredLoop]) -> list[Array]:
    """Return what the offsets (planes,) of the windows of a file have in common, for each log [rad].

    A log that is no window, or the only one of its file with an offset, shares nothing.
    """
    shared = [np.zeros(loop.planes) for loop in loops]
    for places in windows_of_files(loops):
        found = [offset for place in places if (offset := offsets[place]) is not None]
        if len(found) > 1:
            for place in places:
                shared[place] = np.mean(found, axis=0)
    return shared


def _all_residuals(episodes: Sequence[Episode | None], loops: Sequence[MeasuredLoop], weight: float) -> Array:
    errors = [bend_errors(episode, loop) for episode, loop in zip(episodes, loops, strict=True)]
    taken_off = offsets_taken_off(errors, loops)
    of_logs = zip(episodes, loops, errors, taken_off, strict=True)
    return np.concatenate([_of_log(*of_log, weight) for of_log in of_logs])


def _of_log(
    episode: Episode | None, loop: MeasuredLoop, errors: list[Array], offsets: Array, weight: float
) -> Array:
    count, scales = np.count_nonzero(loop.fitted), scales_of(loop)
    if episode is None:
        return np.full(count * len(scales) + loop.planes, _HOPELESS / np.sqrt(count))
    off = [(error - offset)[loop.fitted] for error, offset in zip(errors, offsets, strict=True)]
    if loop.tension.size:
        off += list((episode.tension[:, :2] - loop.tension)[loop.fitted].T)
    off = [error / scale for error, scale in zip(off, scales, strict=True)]
    weighted: Array = np.concatenate(off) / np.sqrt(count)
    return np.concatenate([weighted, weight * offsets / OFFSET_SPREAD])


MOST = 30.0
"""Largest factor between a scale and the usual one: a channel with an exact fit does not outweigh the
others."""


def weighed(loops: Sequence[MeasuredLoop], residual: Array) -> list[MeasuredLoop]:
    """Return logs whose samples cost the same by what a fit leaves of each channel (R,), in sum as before."""
    places = channels(loops)
    left = np.array([float(residual[place] @ residual[place]) for of_log in places for place in of_log])
    count = np.array([place.stop - place.start for of_log in places for place in of_log])
    total = left.sum()
    if not total > 0:
        return list(loops)
    each = left / np.maximum(count, 1) / (total / count.sum())
    factor = np.clip(np.sqrt(each), 1 / MOST, MOST)
    factor *= np.sqrt((left / factor**2).sum() / total)  # what was clipped would change the sum
    ends = np.cumsum([len(of_log) for of_log in places])[:-1]
    return [
        dataclasses.replace(loop, scales=scales_of(loop) * of_log)
        for loop, of_log in zip(loops, np.split(factor, ends), strict=True)
    ]
