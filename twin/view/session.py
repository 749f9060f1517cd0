"""Sessions of the viewer: a twin that is driven by hand, and a recording that is played."""

import collections
import enum
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.preset.preset import Preset
from twin.signals.streams import SeedUse, random_stream

if TYPE_CHECKING:
    from twin.live import AssuredEstimator

Array = NDArray[np.float64]
LONGEST_STEP_S = 0.1  # a slower machine shows slow motion
TRAIL = 1800  # samples that a live session keeps: a minute at 30 updates/s
SPEEDS = {"pull_mm": 4.0, "lateral_pull_mm": 4.0, "sheath_bend_deg": 90.0, "tip_force_n": 2.0}
"""Fastest change of each input per second: a slider may jump, an endoscope does not."""


class Columns(enum.IntEnum):
    """Columns of a trail; after them come the tensions of all wires at the pulley, then at the tip [N]."""

    TIME_S = 0
    PULL_MM = 1
    LATERAL_PULL_MM = 2
    BEND_DEG = 3
    LATERAL_BEND_DEG = 4
    MEASURED_DEG = 5  # NaN where there is no reading, like all that is not known
    ESTIMATE_DEG = 6
    LOW_DEG = 7  # of the 95 % interval
    HIGH_DEG = 8
    TENSIONS_N = 9


class Inputs(NamedTuple):
    """Inputs of a live session; pulls count from where the command is neutral."""

    pull_mm: float = 0.0
    lateral_pull_mm: float = 0.0
    sheath_bend_deg: float = 0.0
    tip_force_n: float = 0.0
    friction: float = 1.0  # factor of the sheath's friction


class Pose(NamedTuple):
    """What is drawn in 3D."""

    joint_angle: Array  # (vertebrae,) [rad]
    lateral_joint_angle: Array  # likewise; empty with one bending plane
    sheath_bend: float  # [rad]
    tip_force_n: float


class LiveTwin:
    """MuJoCo twin that follows its inputs in real time, with an estimator on its noisy sensor."""

    def __init__(self, preset: Preset, policy: Path | None = None, seed: int = 0) -> None:
        """Build the twin at rest; the sensor has the noise that the trained file states."""
        from twin.live import prepare_runtime
        from twin.physics import Endoscope

        self.preset, self._seed = preset, seed
        self._twin = Endoscope.from_preset(preset, drawn=False)
        self._new_runtime = None if policy is None else prepare_runtime(policy, start="rest")
        self.reset()

    @property
    def method(self) -> str:
        """Name of the trained method; empty without one."""
        return "" if self._runtime is None else self._runtime.method

    @property
    def limits(self) -> Inputs:
        """Largest input of each kind: a section bent by more than a right angle, a loop of the sheath."""
        preset = self.preset
        reach_mm = max(1.0, float(round(min(1.3e3 * math.pi * preset.wire_offset, 10.0))))
        force = float(f"{2 * preset.section_stiffness / preset.section_length:.1g}")
        return Inputs(reach_mm, reach_mm, max(360.0, self.inputs.sheath_bend_deg), force, 3.0)

    def reset(self) -> None:
        """Return to straight and at rest, with a new sheath and an estimator that knows this."""
        self._twin.reset()
        self.inputs = Inputs(sheath_bend_deg=math.degrees(self.preset.sheath_bend))
        self.time_s = self._due_s = self._behind_s = 0.0
        self._random = random_stream(self._seed, SeedUse.VIEW_NOISE)
        self._runtime: AssuredEstimator | None = self._new_runtime and self._new_runtime(0.0)
        lag_s = 0.0 if self._runtime is None else self._runtime.sensor.lag_s
        late = 1 + round(lag_s / self.preset.control_period)
        self._bends_deg = collections.deque([0.0] * late, maxlen=late)
        self._reading = (math.nan,) * 4
        self._trail = np.tile(self._sample(), (1, 1))

    def advance(self, seconds: float, wanted: Inputs) -> None:
        """Advance by a time, towards the wanted inputs; raise `FloatingPointError` if it diverges."""
        period = self.preset.control_period
        self._behind_s += min(seconds, LONGEST_STEP_S)
        while self._behind_s >= period:
            self._behind_s -= period
            self._step(wanted)
        self._trail = np.vstack([self._trail[-TRAIL + 1 :], self._sample()])

    def pose(self) -> Pose:
        """Return the present pose."""
        twin, inputs = self._twin, self.inputs
        bend = math.radians(inputs.sheath_bend_deg)
        return Pose(twin.joint_angle().copy(), twin.lateral_joint_angle().copy(), bend, inputs.tip_force_n)

    def trail(self) -> Array:
        """Return the samples of the last minute, (N, columns); see `Columns`."""
        return self._trail

    def _step(self, wanted: Inputs) -> None:
        twin, preset = self._twin, self.preset
        moved = {
            name: value + float(np.clip(getattr(wanted, name) - value, -most, most))
            for name, most in ((name, speed * preset.control_period) for name, speed in SPEEDS.items())
            for value in [getattr(self.inputs, name)]
        }
        self.inputs = inputs = wanted._replace(**moved)
        twin.push_tip(inputs.tip_force_n)
        twin.scale_friction(inputs.friction)
        pull, lateral_pull = (*self._pulls_m(), 0.0)[:2]
        twin.advance(pull, lateral_pull, math.radians(inputs.sheath_bend_deg))
        self.time_s += preset.control_period
        self._bends_deg.append(math.degrees(twin.bend()))
        if self._runtime is not None and self.time_s >= self._due_s - 1e-9:
            self._due_s += self._runtime.sample_time
            self._measure(self._runtime)

    def _pulls_m(self) -> tuple[float, ...]:
        pulls = self.inputs.pull_mm, self.inputs.lateral_pull_mm
        return tuple(zero + 1e-3 * of for zero, of in zip(self.preset.command_zeros, pulls, strict=False))

    def _measure(self, runtime: "AssuredEstimator") -> None:
        sensor = runtime.sensor
        angle_deg = self._bends_deg[0] + self._random.normal(0.0, math.sqrt(runtime.noise_variance))
        measured_deg = sensor.scale * angle_deg + sensor.zero_deg
        reading = runtime.push(self.time_s, 1e3 * self._pulls_m()[0], measured_deg)
        self._reading = (angle_deg, reading.bend_deg, *(reading.interval_deg or (math.nan, math.nan)))

    def _sample(self) -> Array:
        twin, tension = self._twin, self._twin.wire_tension()
        pulls_mm = self.inputs.pull_mm, self.inputs.lateral_pull_mm
        bends_deg = math.degrees(twin.bend()), math.degrees(twin.lateral_bend())
        return np.array([self.time_s, *pulls_mm, *bends_deg, *self._reading, *tension[:, 0], *tension[:, -1]])


class Playback:
    """Recording that is played: the present is its sample at `time_s`."""

    def __init__(self, path: Path) -> None:
        """Read a recording, with the estimate of its first method if it holds any."""
        from twin.recording import read_episode
        from twin.recording.messages import ESTIMATE_PREFIX
        from twin.recording.reader import estimate_topics, read_intervals
        from twin.rendering.actor import hinge_angles_of, shape_of

        self.episode = episode = read_episode(path)
        self._joint_angle = hinge_angles_of(episode)
        self.preset = shape_of(episode, self._joint_angle.shape[1])
        self.time_s, self.last_s = 0.0, float(episode.time[-1] - episode.time[0])
        count, unknown = len(episode.time), np.full(len(episode.time), np.nan)
        topic = next(iter(estimate_topics(path)), "")
        self.method = topic.removeprefix(ESTIMATE_PREFIX).replace("_", " ")
        estimates = read_intervals(path, topic) if topic else np.empty((0, 3))
        angles = np.degrees([episode.bend, _or(episode.lateral_bend, unknown), episode.measured_bend])
        tensions = episode.wire_tension if episode.wire_tension.size else np.empty((count, 0, 1))
        self._rows = np.column_stack(
            [
                episode.time - episode.time[0],
                *(1e3 * of for of in (episode.pull, _or(episode.lateral_pull, unknown))),
                *angles,
                estimates if len(estimates) else np.full((count, 3), np.nan),
                tensions[:, :, 0],
                tensions[:, :, -1],
            ]
        )

    def pose(self) -> Pose:
        """Return the pose at the present time; an arc where no hinges are recorded."""
        index, episode = self._index, self.episode
        lateral, sheath = episode.lateral_joint_angle, episode.sheath_bend
        bend = float(sheath[index]) if len(sheath) else self.preset.sheath_bend
        return Pose(self._joint_angle[index], lateral[index] if len(lateral) else np.empty(0), bend, 0.0)

    def trail(self) -> Array:
        """Return the samples from the start to the present time, (N, columns); see `Columns`."""
        return self._rows[: self._index + 1]

    @property
    def _index(self) -> int:
        return max(int(np.searchsorted(self._rows[:, 0], self.time_s + 1e-9)) - 1, 0)


Session = LiveTwin | Playback


def _or(values: Array, otherwise: Array) -> Array:
    return values if len(values) else otherwise
