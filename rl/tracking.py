"""Tracking of a bend as an environment for Gymnasium: the endoscope in the loop, one command at a time.

The action moves an offset from the pull of the nominal endoscope's line. An action of zero is control by the
line, which ignores hysteresis. As the offset is the sum of all actions, a policy that is linear in the error
and the low-passed error is a PI law.
"""

import dataclasses
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from twin.control.conditions import SIGNALS, reference
from twin.control.controller import MARGIN, CommandLimits, fit_line
from twin.control.controllers.ppo import ERROR_DEG, OBSERVATION_LIMIT, OBSERVED, Observation, TrackingView
from twin.control.trial import Plant
from twin.errors import InputError
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import load_ranges
from twin.signals.noise import draw_noise
from twin.signals.sensor import samples_late

if TYPE_CHECKING:
    from twin.rendering.cameras import Portrait

Array = NDArray[np.float64]

TRAVEL_COST_PER_MM = 0.1  # cost of travel: the fastest command costs a quarter of what an error of 1 deg does


@dataclasses.dataclass(frozen=True)
class TrackingState:
    """Complete state of an environment: restored, the run goes on bit for bit."""

    preset: Preset  # the endoscope of this episode
    plant: tuple[Any, float, float]  # its state, of `Plant.save_state`
    reference_deg: Array  # (N,) wanted angle [deg]
    noise_deg: Array  # (N,) added to the true angle [deg]
    sample: int  # number of the sample it stands at
    bends_deg: tuple[float, ...]  # true angles that the sensor's latency keeps, the oldest first [deg]
    change_mm: float  # latest change of the command [mm]
    smooth_deg: float  # low-passed error [deg]
    generator: Any  # state of the random numbers, of NumPy


class TrackingEnvironment(gymnasium.Env[Observation, NDArray[np.float32]]):
    """An endoscope that is to follow a reference of its bend; id `EndoTwin/Tracking-v0`.

    An observation is six numbers, of about unit size and within +-10, those of `TrackingView`.
    An action in [-1, 1] is the change of the offset [speed limit times T]. The offset is added to the line's
    pull for the next reference, and their sum is bounded by `CommandLimits`. The reward is
    -(error / `ERROR_DEG`)^2 of the true angle at the next sample, less `TRAVEL_COST_PER_MM` times the travel.
    An episode is `truncated` after the last sample of its reference; nothing terminates it. The truth is in
    the reward and in the info (`bend_deg`, `reference_deg`, `pull_mm`), and in no observation.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012  Gymnasium's own name

    def __init__(
        self,
        preset: str | Preset = "ureteroscope",
        *,
        randomized: bool = False,
        stroke_mm: tuple[float, float] = (-1.0, 1.0),
        speed_mm_s: float = 5.0,
        signals: Sequence[str] = SIGNALS,
        noise_variance: float = 1.0,
        sample_time: float = 0.02,
        seconds: float = 20.0,
        physics: str = "mujoco",
        render_mode: str | None = None,
    ) -> None:
        """Build the nominal endoscope and fit its line.

        Args:
            preset: the nominal endoscope, or its name.
            randomized: whether every episode draws another endoscope, from the ranges of the preset's file;
                line and scales remain those of the nominal one.
            stroke_mm: lowest and highest pull of the work, which references are made for; the command may
                go further at either end, by `twin.control.controller.MARGIN` of its width [mm].
            speed_mm_s: fastest change of the command [mm / s].
            signals: kinds of reference, one of which each episode draws (`twin.control.conditions.SIGNALS`).
            noise_variance: R of the Gaussian noise of measurements [deg^2].
            sample_time: T [s].
            seconds: length of an episode after its hold at the start [s].
            physics: `mujoco`, or `reduced`, which is faster.
            render_mode: `rgb_array`, or None where nothing is drawn.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"unknown render_mode {render_mode!r:.40}; valid: None, rgb_array")
        self.nominal = preset if isinstance(preset, Preset) else load_preset(preset)
        source = self.nominal.name if isinstance(preset, Preset) else preset
        self.ranges = load_ranges(source) if randomized else None
        self.limits = CommandLimits(*stroke_mm, speed_mm_s).wider(MARGIN)
        self.physics, self.sample_time, self.seconds = physics, sample_time, seconds
        self.plant = Plant(self.nominal, sample_time, physics)
        self.line = fit_line(self.nominal, stroke_mm)
        self.view = TrackingView(self.line, self.limits, sample_time)
        self.signals, self.noise_variance = tuple(signals), noise_variance
        self._check_signals()
        self.observation_space = gymnasium.spaces.Box(
            -OBSERVATION_LIMIT, OBSERVATION_LIMIT, (OBSERVED,), np.float32
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.metadata = {**self.metadata, "render_fps": round(1 / sample_time)}
        self.render_mode = render_mode
        self._portrait: Portrait | None = None
        self._reference = self._noise = np.empty(0)
        self._sample, self._change, self._smooth = 0, 0.0, 0.0
        self._bends: deque[float] = deque()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Draw the endoscope, the reference and its noise; begin at rest near the first reference."""
        super().reset(seed=seed)
        rng = self.np_random
        if self.ranges is not None:
            self._drive(self.ranges.draw(self.nominal, rng))
        signal = self.signals[rng.integers(len(self.signals))]
        self._reference = reference(signal, self.line.reached_deg, self.seconds, self.sample_time, rng)
        self._noise = draw_noise("gaussian", self.noise_variance, self._reference.shape, rng)
        pull_mm = self.limits.nearest(self.line.pull_mm(float(self._reference[0])))
        late = samples_late(self.plant.preset.sensor_latency, self.sample_time)
        self._bends = deque([self.plant.start(pull_mm)], maxlen=late + 1)
        self._sample, self._change, self._smooth = 0, 0.0, 0.0
        self._smoothen()
        return self._observe(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance by one sample; `truncated` at the end of the reference."""
        if self._sample + 1 >= len(self._reference):
            raise gymnasium.error.ResetNeeded("no episode, or one that is over: reset the environment first")
        before_mm, now = self.plant.pull_mm, float(self._reference[self._sample])
        following = float(self._reference[self._sample + 1])
        wanted_mm = self.view.wanted_mm(float(np.asarray(action).item()), before_mm, now, following)
        pull_mm = self.limits.within(wanted_mm, before_mm, self.sample_time)
        self._bends.append(self.plant.step(pull_mm))
        self._sample, self._change = self._sample + 1, pull_mm - before_mm
        self._smoothen()
        error = (self._bends[-1] - self._reference[self._sample]) / ERROR_DEG
        reward = -float(error**2) - TRAVEL_COST_PER_MM * abs(self._change)
        ended = self._sample + 1 == len(self._reference)
        return self._observe(), reward, False, ended, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the endoscope from the side, (height, width, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        if self._portrait is None:
            from twin.rendering.cameras import Portrait  # reduced twins are trained on without MuJoCo

            self._portrait = Portrait(self.nominal)
        return self._portrait.picture(self.plant.endoscope.joint_angle())

    def close(self) -> None:
        """Release what draws."""
        self._portrait = None

    def save_state(self) -> TrackingState:
        """Return the complete state, random numbers included."""
        return TrackingState(
            self.plant.preset,
            self.plant.save_state(),
            self._reference,
            self._noise,
            self._sample,
            tuple(self._bends),
            self._change,
            self._smooth,
            self.np_random.bit_generator.state,
        )

    def restore_state(self, state: TrackingState) -> Observation:
        """Restore a state of an environment of the same settings; returns the observation there."""
        if state.preset != self.plant.preset:
            self._drive(state.preset)
        self.plant.restore_state(state.plant)
        self._reference, self._noise, self._sample = state.reference_deg, state.noise_deg, state.sample
        late = samples_late(state.preset.sensor_latency, self.sample_time)
        self._bends = deque(state.bends_deg, maxlen=late + 1)
        self._change, self._smooth = state.change_mm, state.smooth_deg
        self.np_random.bit_generator.state = state.generator
        return self._observe()

    def _check_signals(self) -> None:
        if not self.signals:
            raise InputError(f"signals: at least one is needed; valid: {', '.join(SIGNALS)}")
        rng = np.random.default_rng(0)
        for signal in self.signals:
            reference(signal, self.line.reached_deg, self.seconds, self.sample_time, rng)
        draw_noise("gaussian", self.noise_variance, (1,), rng)

    def _drive(self, preset: Preset) -> None:
        self.plant = Plant(preset, self.sample_time, self.physics)

    def _error_deg(self) -> float:
        """Return the measured error; with latency, the sensor shows the oldest stored angle."""
        measured = self._bends[0] + self._noise[self._sample]
        return float(measured - self._reference[self._sample])

    def _smoothen(self) -> None:
        self._smooth = self.view.smoothed(self._smooth, self._error_deg())

    def _observe(self) -> Observation:
        now = float(self._reference[self._sample])
        following = float(self._reference[min(self._sample + 1, len(self._reference) - 1)])
        return self.view.observation(
            self._error_deg(), self._smooth, now, following, self.plant.pull_mm, self._change
        )

    def _info(self) -> dict[str, Any]:
        return {
            "bend_deg": self._bends[-1],
            "reference_deg": float(self._reference[self._sample]),
            "pull_mm": self.plant.pull_mm,
        }
