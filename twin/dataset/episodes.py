"""Simulation of the episodes of a recipe: draw commands and endoscopes, simulate them, add a sensor."""

import dataclasses
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.dataset.recipe import Conditions, EpisodeKey, Recipe, in_metres, of_each_episode
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.preset.preset import Preset
from twin.recording.features import statistics
from twin.signals.excitation import command
from twin.signals.noise import draw_noise
from twin.signals.sensor import measure
from twin.simulation import simulate_batch
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # datasets are verified without it
        return "not installed"


VERSIONS = {"endotwin": __version__, "mujoco": _installed("mujoco")}
"""Versions that the bytes of a dataset depend on, as stated in its metadata and `dataset.json`."""

_STREAMS = 4  # of random numbers: signal, sensor, lateral signal, preset


class _Drawn(NamedTuple):
    key: EpisodeKey
    conditions: Conditions
    preset: Preset  # as drawn
    pull: Array  # (N,) commanded pulling distance of wire a [m]
    lateral_pull: Array | None  # (N,) of wire c [m]
    sheath_bend: Array | None  # (N,) [rad]; None if it does not change
    sensor_rng: np.random.Generator


def make_episode(recipe: Recipe, key: EpisodeKey) -> Episode:
    """Simulate one episode of a recipe; `DivergedError` if the simulation diverged."""
    episode = make_episodes(recipe, [key])[0]
    if episode is None:
        raise DivergedError(diverged(recipe, key))
    return episode


def make_episodes(recipe: Recipe, keys: Sequence[EpisodeKey]) -> list[Episode | None]:
    """Simulate episodes of a recipe together, on one thread; each is the same as if it were made alone.

    Returns the episodes in the order of the keys, None for one that diverged.
    """
    drawn = [_draw(recipe, key) for key in keys]
    records = simulate_batch(
        [one.preset for one in drawn],
        [one.pull for one in drawn],
        recipe.sample_time_s,
        physics=recipe.physics,
        sheath_bends=[one.sheath_bend for one in drawn],
        lateral_pulls=[one.lateral_pull for one in drawn],
        threads=1,
    )
    return [record and _with_sensor(recipe, one, record) for one, record in zip(drawn, records, strict=True)]


def diverged(recipe: Recipe, key: EpisodeKey) -> str:
    """Return the error message for an episode whose simulation diverged."""
    what = "narrow the ranges" if recipe.ranges else "lower time_step or the stiffness of the wires"
    of = f"episode {key.number} of seed {key.seed}: the simulation of {recipe.preset.name!r}"
    return f"{of} diverged: {what}"


def stereo_seed(key: EpisodeKey) -> np.random.SeedSequence:
    """Return the seed of what two cameras measure of an episode, independent of its other streams."""
    return np.random.SeedSequence([key.seed, key.number], spawn_key=(_STREAMS,))


def _draw(recipe: Recipe, key: EpisodeKey) -> _Drawn:
    # The same stream for the same key, however many episodes and workers there are.
    streams = np.random.SeedSequence([key.seed, key.number]).spawn(_STREAMS)
    signal_rng, sensor_rng, lateral_rng, preset_rng = map(np.random.default_rng, streams)
    conditions = recipe.conditions(key.number)
    bend = conditions.sheath_bend_deg
    preset = recipe.preset if bend is None else recipe.preset.replace(sheath_bend=float(np.radians(bend[0])))
    if recipe.ranges is not None:
        preset = recipe.ranges.draw(preset, preset_rng)
    if recipe.given_pull_m is not None:
        pull = np.array(recipe.given_pull_m)
    else:
        stroke = in_metres(conditions.stroke_mm)
        pull = command(conditions.signal, stroke, recipe.seconds, recipe.sample_time_s, signal_rng)
    lateral_pull = None
    if recipe.given_lateral_pull_m is not None:
        lateral_pull = np.array(recipe.given_lateral_pull_m)
    if recipe.lateral_stroke_mm is not None:
        kind = recipe.signals[(key.number + 1) % len(recipe.signals)]
        stroke, seconds = in_metres(recipe.lateral_stroke_mm), len(pull) * recipe.sample_time_s
        lateral_pull = command(kind, stroke, seconds, recipe.sample_time_s, lateral_rng)
    sheath_bend = None
    if bend is not None and bend[0] != bend[1]:
        sheath_bend = np.linspace(np.radians(bend[0]), np.radians(bend[1]), len(pull))
    return _Drawn(key, conditions, preset, pull, lateral_pull, sheath_bend, sensor_rng)


def _with_sensor(recipe: Recipe, drawn: _Drawn, record: Episode) -> Episode:
    """Return the record with the sensor's measurements, and with its origin in the metadata."""
    if recipe.stereo is None:
        seen = measure(drawn.preset, record.time, record.bend, drawn.sensor_rng)
        noise = draw_noise("gaussian", recipe.sensor_variance_deg2, drawn.pull.shape, drawn.sensor_rng)
        seen = seen + np.radians(noise)
    else:
        seen = _measured_by_cameras(recipe.stereo, drawn.key, record)
    episode = dataclasses.replace(record, measured_bend=seen)
    text, sha256 = of_each_episode(recipe)
    origin = {
        "seed": drawn.key.seed,
        "episode": drawn.key.number,
        "signal": drawn.conditions.signal,
        "stroke_mm": list(drawn.conditions.stroke_mm),
        "samples": len(record.time),
        "recipe_sha256": sha256,
        "statistics": statistics(episode),
    }
    if drawn.conditions.sheath_bend_deg is not None:
        origin["sheath_bend_deg"] = list(drawn.conditions.sheath_bend_deg)
    return dataclasses.replace(
        episode,
        metadata=episode.metadata | VERSIONS | origin,
        attachments=episode.attachments | {"recipe.yaml": text.encode()},
    )


def _measured_by_cameras(rig: StereoRig, key: EpisodeKey, record: Episode) -> Array:
    from twin.vision.sensor import sensor_before  # OpenCV, an extra

    measured = sensor_before(record, rig).measure(record, stereo_seed(key))
    if np.isnan(measured).all():
        raise InputError(
            f"episode {key.number} of seed {key.seed}: the stereo sensor measures it in no picture: less "
            "blur or noise, more light, larger markers, or a larger half_height"
        )
    return measured
