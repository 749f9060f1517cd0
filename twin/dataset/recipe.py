"""Recipe of a dataset: everything that it depends on, and the conditions of each of its episodes."""

import dataclasses
import functools
import hashlib
import itertools
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import yaml

from twin.errors import InputError
from twin.files.bounds import LARGEST_VARIANCE_DEG2, LONGEST_SECONDS, check_between
from twin.files.shown import shown
from twin.mechanics.wire import spring_law, stretch_at, wound_tension
from twin.preset.preset import Preset, at_sample_time, parameter_limits
from twin.preset.randomization import Ranges
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS, command
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM
from twin.simulation import PHYSICS, check_physics
from twin.vision.rig import StereoRig

Interval = tuple[float, float]
MOST_EPISODES = 10_000  # of one seed: their files are numbered with four digits
MOST_SAMPLES = 1_000_000  # of one episode, which a worker holds in memory: about 750 MB
MOST_SAMPLES_IN_ALL = 1_000_000_000  # of a dataset
MOST_IN_ALL = 20_000  # episodes of all seeds: a `dataset.json` of more is not read
MOST_GIVEN = 100_000  # samples of a given command: a recipe's file of more is not read
LARGEST_SEED = 2**128 - 1  # NumPy's generators take 128 bits of entropy


class EpisodeKey(NamedTuple):
    """Seed of an episode and its number within the seed, from 0; all that is random is drawn from these."""

    seed: int
    number: int


class Conditions(NamedTuple):
    """Conditions of one episode by the recipe, before anything is drawn."""

    signal: str
    stroke_mm: Interval  # lowest and highest pulling distance of wire a [mm]
    sheath_bend_deg: Interval | None  # at the start and at the end [deg]; None for the preset's own


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Recipe of a dataset. Signals, strokes and bends of the sheath are combined, in turn.

    Attributes:
        preset: the endoscope.
        strokes_mm: lowest and highest pulling distances of wire a [mm].
        lateral_stroke_mm: lowest and highest pulling distance of wire c, for an endoscope with two bending
            planes [mm]; None: wire c is not pulled.
        sheath_bends_deg: bends of the sheath at the start, when the wires are wound up, and at the end of an
            episode, changing evenly [deg]; empty for the preset's own.
        ranges: ranges around the preset that the parameters of each episode's endoscope are drawn from.
        seconds: length of each episode [s].
        sample_time_s: time between two samples [s].
        signals: kinds of signal.
        sensor_variance_deg2: variance of the Gaussian noise in `/measurement`, in addition to that of the
            preset's sensor [deg^2].
        stereo: two cameras that measure the bending angle instead of the preset's sensor.
        camera: rate and size of pictures to take.
        episodes: number of episodes of each seed.
        seeds: seeds.
        given_pull_m: (N,) command of wire a to follow instead of a drawn one [m].
        given_lateral_pull_m: (N,) the same of wire c [m].
        physics: the twin that simulates, `mujoco` or `reduced`.
    """

    preset: Preset
    strokes_mm: tuple[Interval, ...] = ((2.0, 4.0),)
    lateral_stroke_mm: Interval | None = None
    sheath_bends_deg: tuple[Interval, ...] = ()
    ranges: Ranges | None = None
    seconds: float = 60.0
    sample_time_s: float = 0.02
    signals: tuple[str, ...] = tuple(SIGNALS)
    sensor_variance_deg2: float = 0.1
    stereo: StereoRig | None = None
    camera: Camera | None = None
    episodes: int = 5
    seeds: tuple[int, ...] = (0,)
    given_pull_m: tuple[float, ...] | None = None
    given_lateral_pull_m: tuple[float, ...] | None = None
    physics: str = PHYSICS[0]

    @property
    def keys(self) -> list[EpisodeKey]:
        """All episodes, in order."""
        return [EpisodeKey(*key) for key in itertools.product(self.seeds, range(self.episodes))]

    @property
    def combinations(self) -> int:
        """Number of combinations of signal, stroke and bend of the sheath."""
        signals = len(self.signals) if self.given_pull_m is None else 1
        return signals * len(self.strokes_mm) * max(len(self.sheath_bends_deg), 1)

    def conditions(self, number: int) -> Conditions:
        """Return the conditions of the episodes of this number: signals change fastest, then strokes."""
        signals = self.signals if self.given_pull_m is None else ("given",)
        turn, place = divmod(number, len(signals))
        turn, stroke = divmod(turn, len(self.strokes_mm))
        bends = self.sheath_bends_deg
        bend = bends[turn % len(bends)] if bends else None
        return Conditions(signals[place], self.strokes_mm[stroke], bend)

    def file_name(self, key: EpisodeKey) -> str:
        """Return the name of the file of an episode; it includes the seed where there are several."""
        seed = f"seed_{key.seed}_" if len(self.seeds) > 1 else ""
        return f"{seed}episode_{key.number:04d}.mcap"

    @property
    def unmet(self) -> str | None:
        """Warning if there are too few episodes to include every stroke and bend of the recipe."""
        conditions = [self.conditions(number) for number in range(self.episodes)]
        met = len({(one.stroke_mm, one.sheath_bend_deg) for one in conditions})
        named = len(self.strokes_mm) * max(len(self.sheath_bends_deg), 1)
        if met >= named:
            return None
        count = "1 episode" if self.episodes == 1 else f"{self.episodes} episodes"
        return (
            f"{count} of each seed meet only {met} of {named} pairs of stroke and bend; "
            f"for all, take {self.combinations}"
        )

    def check(self) -> None:
        """Refuse, before any work, values that would fail in an episode."""
        for name in ("seeds", "signals", "strokes_mm"):
            if not getattr(self, name):
                raise InputError(f"{name}: none is given, at least one is needed")
        check_between("episodes", self.episodes, 1, MOST_EPISODES, "of each seed")
        for seed in self.seeds:
            check_between("seed", seed, 0, LARGEST_SEED)
        if len(set(self.seeds)) < len(self.seeds):
            raise InputError(f"seeds = {shown(list(self.seeds))}: one is given twice")
        check_physics(self.physics)
        if self.physics == "reduced":
            from twin.reduced.parameters import refuse_gravity

            refuse_gravity(self.preset)
        if not 0 <= self.sensor_variance_deg2 <= LARGEST_VARIANCE_DEG2:
            variance = f"variance of the sensor {self.sensor_variance_deg2:g} deg^2"
            raise InputError(f"{variance}: must be from 0 to {LARGEST_VARIANCE_DEG2:g}")
        self._check_size()
        self._check_commands()
        if self.sheath_bends_deg and self.ranges is not None and "sheath_bend" in self.ranges.to_dict():
            raise InputError("sheath_bends_deg and a range of sheath_bend: choose one")
        low, high = parameter_limits("sheath_bend")
        for bend in itertools.chain(*self.sheath_bends_deg):
            if not low <= np.radians(bend) <= high:
                most = f"must be from 0 to {np.degrees(high):g} deg"
                raise InputError(f"bend of the sheath {bend:g} deg: {most}")
        if self.camera is not None:
            self.camera.check()

    def _check_size(self) -> None:
        at_sample_time(self.preset, self.sample_time_s)
        samples, files = self.seconds / self.sample_time_s, self.episodes * len(self.seeds)
        for count, most, what in (
            (self.seconds, LONGEST_SECONDS, "s of an episode"),
            (samples, MOST_SAMPLES, "samples of an episode"),
            (files, MOST_IN_ALL, "episodes of a dataset"),
            (samples * files, MOST_SAMPLES_IN_ALL, "samples of a dataset"),
        ):
            if not count <= most:
                raise InputError(f"{count:.10g} {what}: at most {most:.10g}")

    def _check_commands(self) -> None:
        given, lateral = self.given_pull_m, self.given_lateral_pull_m
        if given is not None:
            if len(given) > MOST_GIVEN:
                rest = f"at most {MOST_GIVEN}, raise the sample time or cut it"
                raise InputError(f"a given command of {len(given)} samples: {rest}")
            lasts = len(given) * self.sample_time_s
            if abs(lasts - self.seconds) > 1e-9 * lasts:
                raise InputError(f"{self.seconds:g} s: the given command lasts {lasts:g} s")
        if lateral is not None:
            if self.lateral_stroke_mm is not None:
                raise InputError("lateral_stroke_mm and a recorded lateral command: choose one")
            if len(lateral) != len(given or ()):
                raise InputError(
                    f"given_lateral_pull_m has {len(lateral)} samples, given_pull_m {len(given or ())}"
                )
        if self.preset.bending_planes == 1 and not (self.lateral_stroke_mm is lateral is None):
            what = "stroke" if lateral is None else "command"
            raise InputError(f"a lateral {what}: {self.preset.name!r} has one bending plane, it needs two")
        sideways = [] if self.lateral_stroke_mm is None else [self.lateral_stroke_mm]
        followed = [] if lateral is None else [(min(lateral) * 1e3, max(lateral) * 1e3)]
        for stroke in [*self.strokes_mm, *sideways, *followed]:
            check_reached(self.preset, stroke)
        rng = np.random.default_rng(0)
        for stroke in [*(self.strokes_mm if given is None else []), *sideways]:
            for kind in self.signals:
                command(kind, in_metres(stroke), self.seconds, self.sample_time_s, rng)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as a recipe's file holds them (see `twin.dataset.recipe_file`)."""
        sensor: dict[str, Any] = {"variance_deg2": float(self.sensor_variance_deg2)}
        values = {
            "ranges": self.ranges and self.ranges.to_dict(),
            "episodes": self.episodes,
            "seeds": list(self.seeds),
            "seconds": float(self.seconds),
            "sample_time_s": float(self.sample_time_s),
            "signals": list(self.signals),
            "strokes_mm": [_floats(stroke) for stroke in self.strokes_mm],
            "lateral_stroke_mm": self.lateral_stroke_mm and _floats(self.lateral_stroke_mm),
            "sheath_bends_deg": [_floats(bend) for bend in self.sheath_bends_deg],
            "sensor": {"stereo": dataclasses.asdict(self.stereo)} if self.stereo else sensor,
            "camera": self.camera and dataclasses.asdict(self.camera),
            "preset": self.preset.to_dict(),
            "given_pull_m": self.given_pull_m and _floats(self.given_pull_m),
            "given_lateral_pull_m": self.given_lateral_pull_m and _floats(self.given_lateral_pull_m),
            # Left out where it is the default: recipes of earlier versions keep their hash.
            "physics": None if self.physics == PHYSICS[0] else self.physics,
        }
        return {name: value for name, value in values.items() if value is not None and value != []}


def _floats(numbers: Iterable[float]) -> list[float]:  # 2 and 2.0 are one recipe, and must be one text
    return [float(number) for number in numbers]


def in_metres(stroke_mm: Interval) -> Interval:
    """Return an interval of pulling distances [m]."""
    return stroke_mm[0] * 1e-3, stroke_mm[1] * 1e-3


@functools.lru_cache(maxsize=8)
def to_yaml(recipe: Recipe) -> str:
    """Return a recipe as the text of its file."""
    # In flow style: not a line for each sample of a given command.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return yaml.dump(recipe.to_dict(), Dumper=dumper, sort_keys=False, default_flow_style=None, width=110)


@functools.lru_cache(maxsize=8)
def of_each_episode(recipe: Recipe) -> tuple[str, str]:
    """Return what one episode depends on except its key, as the text of a file, and its SHA-256.

    The numbers of episodes and seeds are left out.
    """
    text = to_yaml(dataclasses.replace(recipe, episodes=1, seeds=(0,)))
    return text, hashlib.sha256(text.encode()).hexdigest()


def farthest_pull(preset: Preset) -> float:
    """Return the magnitude of the farthest pulling distance that is simulated [m].

    It bends the section by `LARGEST_BEND_DEG` without friction, the other wire slack, and is at most
    `LARGEST_PULL_MM`. The wires are elastic: the moment that the section needs stretches the wire that pulls.
    A pull far beyond is in another unit, micrometres given as millimetres or millimetres as metres.
    """
    bend = np.radians(LARGEST_BEND_DEG)
    moment = preset.section_stiffness * bend * (1 + preset.section_stiffening * bend**2)
    springs = spring_law(preset)
    # All segments in series carry the tension; the stretch by winding up is there already.
    stretch = (preset.sheath_elements + 1) * float(
        stretch_at(np.array(moment / preset.wire_offset), *springs)
    )
    wound = float(stretch_at(wound_tension(preset), *springs).sum())
    return float(min(preset.wire_offset * bend + max(stretch - wound, 0.0), LARGEST_PULL_MM * 1e-3))


def check_reached(preset: Preset, stroke_mm: tuple[float, float]) -> None:
    """Refuse a stroke that goes beyond the farthest pulling distance, or an end of which is no number."""
    farthest_mm = farthest_pull(preset) * 1e3
    if not np.isfinite(stroke_mm).all() or max(map(abs, stroke_mm)) > farthest_mm:
        most = f"this endoscope is pulled by at most {farthest_mm:.3g} mm"
        raise InputError(f"stroke [{stroke_mm[0]:g}, {stroke_mm[1]:g}] mm: {most}: is the unit right?")
