"""Inverse of RAM (twins)' weighted members: hysteresis is compensated by the twins that follow the endoscope.

The members and the estimate of the trained file are those of the runtime, which trusts RAM (twins) only as
long as its monitor does (`twin/runtime/assured.py`). The command of the next sample is the pull u with

    sum_m w_m [theta_m(u) - theta_m] = r_next - r + share (r - estimate),      share = 1 - exp(-rate T),

where w are the weights that the filter gives the members now, r the reference. Only what the reference
moves and a share of the estimated error are asked for: one that asked for the whole error would follow the
noise of the estimate across the dead band of every reversal. While RAM (twins) is not trusted, linear map and
PI on the fallback's estimate are in charge, without a jump.
"""

import math
from collections.abc import Mapping

from twin.control.controller import Controller, Sensed
from twin.control.controllers.active_model_pi import ACTIVE_MODEL_PI
from twin.control.feedback import PI_SETTINGS, EstimateFeedback
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, Setting, register_controller
from twin.errors import InputError
from twin.estimation.learned.member_weights import MemberWeights
from twin.estimation.learned.ram_twins import RamTwins, TwinsState
from twin.estimation.registry import Style
from twin.runtime.assured import AssuredEstimator
from twin.runtime.load import prepare_runtime
from twin.runtime.reading import Source


class Told:
    """Estimate that is told, in the place of an estimator of its own."""

    def __init__(self, bend_deg: float) -> None:
        self.bend_deg = bend_deg

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> None:
        """Do nothing: `bend_deg` is set."""


class MembersInverse(Controller):
    """Inverse of the weighted members while they are trusted, else PI on the fallback."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._make_runtime = prepare_runtime(
            knowledge.trained, noise_variance=knowledge.noise_variance, sample_time=knowledge.sample_time
        )
        self._share = -math.expm1(-settings["rate_per_s"] * knowledge.sample_time)
        gains = {name: setting.default for name, setting in PI_SETTINGS.items()}
        tuned = knowledge.settings.get(ACTIVE_MODEL_PI.name, {})
        self._fallback = EstimateFeedback(knowledge, Told, gains | dict(tuned))
        self.runtime: AssuredEstimator

    def _start(self, reference_deg: float) -> None:
        self.runtime = self._make_runtime(reference_deg)
        advanced = self.runtime.advanced.estimator
        if not isinstance(advanced, RamTwins):
            raise InputError("an inverse of members needs a trained file of RAM (twins)")
        self._members, self._weights = advanced.members, MemberWeights(advanced.network)
        self.bend_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        reading = self.runtime.push(sensed.time_s, self.pull_mm, sensed.measurement_deg)
        self.bend_deg = reading.bend_deg
        state = self.runtime.advanced.state
        if reading.source is not Source.ADVANCED or not isinstance(state, TwinsState):
            return self._fall_back(sensed)
        self.falls_back = False
        wanted = sensed.next_deg - sensed.reference_deg + self._share * (sensed.reference_deg - self.bend_deg)
        weights = self._weights.of(state)
        now = float(weights @ state.following.of_filters()[0])
        within = self.limits.reach(self.pull_mm, self.sample_time)
        return self._members.common_pull_mm(state.following, weights, now + wanted, within)

    def _fall_back(self, sensed: Sensed) -> float:
        if not self.falls_back:
            self._fallback.start(self.pull_mm, sensed.reference_deg)
        self.falls_back = True
        self._fallback.estimator.bend_deg = self.bend_deg
        return self._fallback.step(sensed)


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> MembersInverse:
    """Return the controller of a run."""
    return MembersInverse(knowledge, settings)


MEMBERS_INVERSE = register_controller(
    ControllerSpec(
        "members-inverse",
        6,
        "members and estimate of RAM (twins)",
        build,
        {"rate_per_s": Setting(3.0, 0.3, 30.0)},
        needs_policy=True,
        ours=True,
        style=Style("#a3195b", "solid", "", 1.6),
    )
)
