"""Making a dataset: episodes of one recipe, each a pure function of recipe and number, written as MCAP."""

import dataclasses
import hashlib
import json
from collections.abc import Callable
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.excitation import SIGNALS, command
from twin.noise import draw_noise
from twin.physics import check_sample_time, simulate
from twin.preset import Preset, parameter_limits
from twin.randomization import Ranges
from twin.recording import write_csv, write_episode
from twin.recording.atomic import write_whole
from twin.sensor import measure

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Everything that a dataset depends on."""

    preset: Preset
    stroke: tuple[float, float]
    """Lowest and highest pulling distance of wire a [m]."""
    lateral_stroke: tuple[float, float] | None = None
    """The same of wire c, for an endoscope with two bending planes; without it, wire c is not pulled."""
    sheath_bend: tuple[float, float] | None = None
    """Angle that the sheath is bent by at the start and at the end of each episode, changing evenly [rad]."""
    ranges: Ranges | None = None
    """Draw the parameters of each episode's endoscope from these ranges around the preset."""
    seconds: float = 60.0
    """Length of each episode."""
    sample_time: float = 0.02
    """Time between two samples [s]."""
    signals: tuple[str, ...] = tuple(SIGNALS)
    """Kinds of signal, taken in turn."""
    sensor_variance_deg2: float = 0.1
    """Variance of the Gaussian noise in `/measurement` [deg^2]."""
    seed: int = 0
    given_command: tuple[float, ...] | None = None
    """A command to follow instead of a drawn one [m]."""

    def check(self) -> None:
        """Refuse, before any work, what would fail in every episode.

        Raises:
            ValueError: a signal, the stroke, the times, the noise or the seed cannot be.
        """
        if self.seed < 0:
            raise ValueError(f"seed = {self.seed}: must not be negative")
        rng = np.random.default_rng(0)
        draw_noise("gaussian", self.sensor_variance_deg2, (1,), rng)
        check_sample_time(self.preset, self.sample_time)
        farthest = 2 * np.pi * self.preset.wire_offset  # as far as a wire is shortened by one whole turn
        for stroke in filter(None, (self.stroke, self.lateral_stroke)):
            if not np.isfinite(stroke).all() or max(map(abs, stroke)) > farthest:
                low, high = _millimetres(stroke)
                most = f"this endoscope is pulled by at most {farthest * 1e3:.3g} mm"
                raise ValueError(f"stroke [{low:g}, {high:g}] mm: {most}")
            if self.given_command is None or stroke is self.lateral_stroke:
                for kind in self.signals:
                    command(kind, stroke, self.seconds, self.sample_time, rng)
        if self.lateral_stroke is not None and self.preset.bending_planes == 1:
            raise ValueError(f"a lateral stroke: {self.preset.name!r} has one bending plane, it needs two")
        low, high = parameter_limits("sheath_bend")
        for bend in self.sheath_bend or ():
            if not low <= bend <= high:
                raise ValueError(
                    f"bend of the sheath {np.degrees(bend):g} deg: must be from 0 to {np.degrees(high):g} deg"
                )


def make_episode(recipe: Recipe, number: int) -> Episode:
    """Simulate one episode of a recipe.

    Raises:
        ValueError: the recipe asks for a signal that cannot be made.
        FloatingPointError: the simulation diverged.
    """
    # The same stream for the same number, however many episodes and workers there are.
    streams = np.random.SeedSequence([recipe.seed, number]).spawn(4)
    signal_rng, sensor_rng, lateral_rng, preset_rng = map(np.random.default_rng, streams)
    preset = recipe.preset if recipe.ranges is None else recipe.ranges.draw(recipe.preset, preset_rng)
    kind = recipe.signals[number % len(recipe.signals)] if recipe.given_command is None else "given"
    if recipe.given_command is not None:
        pull = np.array(recipe.given_command)
    else:
        pull = command(kind, recipe.stroke, recipe.seconds, recipe.sample_time, signal_rng)
    lateral_pull = None
    if recipe.lateral_stroke is not None:
        lateral_kind = recipe.signals[(number + 1) % len(recipe.signals)]
        seconds = len(pull) * recipe.sample_time
        lateral_pull = command(lateral_kind, recipe.lateral_stroke, seconds, recipe.sample_time, lateral_rng)
    sheath_bend = None if recipe.sheath_bend is None else np.linspace(*recipe.sheath_bend, len(pull))
    episode = simulate(preset, pull, recipe.sample_time, lateral_pull=lateral_pull, sheath_bend=sheath_bend)
    seen = measure(preset, episode.time, episode.bend, sensor_rng)
    noise = draw_noise("gaussian", recipe.sensor_variance_deg2, pull.shape, sensor_rng)
    origin = {
        "seed": recipe.seed,
        "episode": number,
        "signal": kind,
        "stroke_mm": _millimetres(recipe.stroke),
    }
    configuration = yaml.safe_dump(describe(recipe), sort_keys=False).encode()
    return dataclasses.replace(
        episode,
        measured_bend=seen + np.radians(noise),
        metadata=episode.metadata | origin,
        attachments=episode.attachments | {"recipe.yaml": configuration},
    )


def write_dataset(
    recipe: Recipe,
    episodes: int,
    folder: Path,
    executor: Executor,
    *,
    csv: bool = False,
    on_episode: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write episodes and, when all are whole, `dataset.json`.

    Args:
        recipe: what to make.
        episodes: how many.
        folder: where; it is made if it does not exist.
        executor: where the work is done; the bytes do not depend on it.
        csv: also write each episode as a table.
        on_episode: told how many of how many are done.

    Returns:
        The contents of `dataset.json`.

    Raises:
        ValueError: there is nothing to write.
    """
    if episodes < 1:
        raise ValueError(f"episodes = {episodes}: must be at least 1")
    folder.mkdir(parents=True, exist_ok=True)
    _refuse_another_dataset(folder, recipe, episodes)
    (folder / "dataset.json").unlink(missing_ok=True)  # it vouches for files that are about to change
    futures = [executor.submit(_write, recipe, number, folder, csv) for number in range(episodes)]
    if on_episode:
        on_episode(0, episodes)
    try:
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            if on_episode:
                on_episode(done, episodes)
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    contents = describe(recipe) | {"endotwin": __version__, "files": [future.result() for future in futures]}
    write_whole(folder / "dataset.json", json.dumps(contents, indent=2) + "\n")
    return contents


def _refuse_another_dataset(folder: Path, recipe: Recipe, episodes: int) -> None:
    """Neither overwrite the episodes of another recipe nor leave them among the new ones.

    Raises:
        ValueError: the folder holds such episodes.
    """
    path = folder / "dataset.json"
    if path.is_file():
        try:
            held = json.loads(path.read_bytes())
        except ValueError as error:
            raise ValueError(f"{path} is damaged: remove it, or choose another --out") from error
        wanted = describe(recipe)
        if not isinstance(held, dict) or {name: held.get(name) for name in wanted} != wanted:
            raise ValueError(f"{folder} holds a dataset of another recipe: choose another --out or remove it")
    ours = {_file_name(number) for number in range(episodes)}
    others = sorted(file.name for file in folder.glob("*.mcap") if file.name not in ours)
    if others:
        raise ValueError(
            f"{folder} holds {others[0]}, which is none of {episodes} episodes: choose another --out"
        )


def _file_name(number: int) -> str:
    return f"episode_{number:04d}.mcap"


def describe(recipe: Recipe) -> dict[str, Any]:
    """Return the recipe as plain values, units in the names; a given command by its hash."""
    given, lateral, bends = recipe.given_command, recipe.lateral_stroke, recipe.sheath_bend
    return {
        "preset": recipe.preset.to_dict(),
        "stroke_mm": _millimetres(recipe.stroke),
        "lateral_stroke_mm": None if lateral is None else _millimetres(lateral),
        "sheath_bend_deg": None if bends is None else [round(float(np.degrees(bend)), 9) for bend in bends],
        "ranges": None if recipe.ranges is None else recipe.ranges.to_dict(),
        "seconds": recipe.seconds,
        "sample_time_s": recipe.sample_time,
        "signals": list(recipe.signals) if given is None else ["given"],
        "command_sha256": None if given is None else hashlib.sha256(np.array(given).tobytes()).hexdigest(),
        "sensor_variance_deg2": recipe.sensor_variance_deg2,
        "seed": recipe.seed,
    }


def _millimetres(stroke: tuple[float, float]) -> list[float]:
    return [round(end * 1e3, 9) for end in stroke]


def _write(recipe: Recipe, number: int, folder: Path, csv: bool) -> dict[str, Any]:
    """Make and write one episode; runs in a worker, which returns a description and no arrays."""
    episode = make_episode(recipe, number)
    path = write_episode(folder / _file_name(number), episode)
    if csv:
        write_csv(path.with_suffix(".csv"), episode)
    return {
        "name": path.name,
        "signal": episode.metadata["signal"],
        "samples": len(episode.time),
        "bend_deg": [round(float(episode.bend_deg.min()), 3), round(float(episode.bend_deg.max()), 3)],
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }
