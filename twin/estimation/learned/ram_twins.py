"""RAM (twins): eq. 10 on an active model that predicts by reduced twins, with a policy that recognises noise.

The M twins of the trained file follow the command; the whole step of filters, recogniser and policy is the
graph of the file, the very one that was trained (`rl/twins/step.py` says what it does). No MuJoCo, no torch.

The initial estimate is not used: where an endoscope stands is known better from its command.
"""

import dataclasses
import functools
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.learned.step_network import (
    ALL_PARTS,
    SAMPLE_TIME,
    UNKNOWN_DEG,
    Memory,
    StepNetwork,
    step_network,
)
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.files.shown import shown

if TYPE_CHECKING:  # twins are loaded when one is used: a table of methods needs none of them
    from twin.reduced.members import Following, Members, MemberSet

Array = NDArray[np.float64]
AGENT = "ram-twins"
STATE = {
    "mean": 1,
    "covariance": 2,
    "counts": 1,
    "samples": 0,
    "statistics": 1,
    "rows": 2,
    "rows_covariance": 2,
    "evidence": 1,
}
"""Axes of each array of the state of one filter."""
RECOGNISER_ALONE, FILTER_ALONE = (0.0, 1.0), (0.0, 0.0)


class TwinsState(NamedTuple):
    """State of B filters.

    Attributes:
        following: the members.
        memory: arrays of the graph, in the order of `STATE`.
        bend_deg: (B,) estimate [deg].
        half_width_deg: (B,) half of its 95 % interval [deg].
    """

    following: "Following"
    memory: Memory
    bend_deg: Array
    half_width_deg: Array


@dataclasses.dataclass(frozen=True)
class RamTwins(Estimator[TwinsState]):
    """A trained step, the twins that it predicts by, and what it is told.

    Attributes:
        network: graph of the trained file.
        twins: that it predicts by.
        sample_time: T, a multiple of the members' control period [s].
        measurement_variance: R, one for all or (B,) [deg^2].
        parts: whether the policy acts and the recogniser is heard, each 1 or 0.
    """

    network: StepNetwork
    twins: "MemberSet"
    sample_time: float = SAMPLE_TIME
    measurement_variance: ArrayLike = 0.1
    parts: tuple[float, float] = ALL_PARTS

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def at(self, sample_time: float) -> Self:
        """Return the estimator for another T [s].

        Raises:
            ValueError: it is no multiple of the members' control period.
        """
        from twin.preset.preset import check_sample_time

        check_sample_time(self.twins.presets[0], sample_time)
        return dataclasses.replace(self, sample_time=sample_time)

    def start(self, pull_mm: Array, bend_deg: Array) -> TwinsState:
        """Return the state at the first sample; the initial estimate is given back there and not used."""
        batch = len(pull_mm)
        unknown = np.full(batch, UNKNOWN_DEG)
        return TwinsState(self.members.start(pull_mm), self.network.start(batch), bend_deg.copy(), unknown)

    def resume(self, trusted: TwinsState, pull_mm: Array, bend_deg: Array) -> TwinsState:
        """Return the state of a stream that begins anew: d takes what it is off by, all else stays."""
        following = self.members.step(trusted.following, pull_mm)
        moved = (following.of_filters() - trusted.following.of_filters()).mean(axis=1)
        off = bend_deg - (trusted.bend_deg + moved)
        memory = dict(zip(STATE, (of.copy() for of in trusted.memory), strict=True))
        begun = memory["covariance"].any(axis=(1, 2))  # a state of zeros has seen nothing: it stays so
        off = off * begun
        memory["mean"][:, -2] += off  # c, d and b
        memory["covariance"][:, -2, -2] += off**2
        memory["rows"][:, :, -1] += off[:, None]  # c and d
        memory["rows_covariance"][:, -1, -1] += off**2
        return TwinsState(following, tuple(memory.values()), bend_deg.copy(), trusted.half_width_deg)

    def step(
        self, state: TwinsState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> TwinsState:
        """Step the members along the command, and the graph with what they say."""
        following = self.members.step(state.following, pull_mm)
        bend, half_width, memory = self.network.step(
            state.memory,
            measurement_deg,
            self.measurement_variance,
            self.sample_time,
            self.parts,
            members_deg=following.of_filters(),
            way_mm=np.abs(pull_mm - previous_pull_mm),
        )
        return TwinsState(following, memory, bend, half_width)

    def bend_deg(self, state: TwinsState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @property
    def has_physics(self) -> bool:
        """True: its members are twins."""
        return True

    @property
    def states_interval(self) -> bool:
        """True if it runs whole: without one of its parts, nobody has trained an interval."""
        return self.parts == ALL_PARTS

    def half_width_deg(self, state: TwinsState) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg]."""
        return state.half_width_deg

    @functools.cached_property
    def members(self) -> "Members":
        """The twins that follow the commands."""
        from twin.reduced.members import Members

        return Members(self.twins, self.sample_time)


def load(path: Path) -> RamTwins:
    """Read a trained step and its members.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    from twin.reduced.members import members_from_dict

    file = read_trained_file(path, AGENT)
    try:
        twins = members_from_dict(file.description.get("members"))
        predicted_by = {"members_deg": (len(twins.presets),), "way_mm": ()}
        network = step_network(file, predicted_by, STATE)
        shapes = network.state
        of_bank = (*shapes["evidence"], *shapes["rows_covariance"][:1])
        squares = all(shapes[name][:1] * 2 == shapes[name] for name in ("covariance", "rows_covariance"))
        if not squares or shapes["covariance"][:1] != shapes["mean"] or shapes["rows"] != of_bank:
            raise InputError(f"the shapes of its state are {shown(tuple(network.state.values()))}")
        return RamTwins(network, twins)
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {AGENT!r}: {error}") from error


def _build(known: Knowledge, parts: tuple[float, float] = ALL_PARTS) -> RamTwins:
    return dataclasses.replace(load(known.file_of(AGENT)), sample_time=known.sample_time, parts=parts)


TRAINING = Training(
    AGENT, POLICY_FILE, load, "RAM on twins that follow the command, trained on simulated ones", on_twins=True
)
RAM_TWINS = register_method(
    MethodSpec(
        name="RAM (twins)",
        noise_information="R",
        build=_build,
        training=TRAINING,
    )
)
register_method(
    MethodSpec(
        name="RAM (twins), recogniser alone",
        noise_information="R",
        build=lambda known: _build(known, RECOGNISER_ALONE),
        trained_as=AGENT,
    )
)
register_method(
    MethodSpec(
        name="RAM (twins), filter alone",
        noise_information="R",
        build=lambda known: _build(known, FILTER_ALONE),
        trained_as=AGENT,
    )
)
