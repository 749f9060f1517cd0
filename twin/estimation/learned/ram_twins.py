"""RAM (twins): eq. 10 on an active model that predicts by reduced twins, with a policy that recognises noise.

The M twins of the trained file follow the command; the whole step of filter, recogniser and policy is the
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
from twin.estimation.learned.scale import LEAST_VARIANCE
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.estimation.registry import MethodSpec, Style, Training, register_method
from twin.files.shown import shown

if TYPE_CHECKING:  # twins are loaded when one is used: a table of methods needs none of them
    from twin.preset.preset import Preset
    from twin.reduced.following import Following, Members

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]
AGENT = "ram-twins"
SAMPLE_TIME = 0.1  # the paper's [s]
UNKNOWN_DEG = 180.0  # half of the interval before anything is measured [deg]
OF_ERROR = -2  # place of d in the state: the last but one
AXES = [1, 2, 1, 0, 1]
"""Axes of each array of the state of one filter: the covariance is square."""
BATCH = 2  # filters that a graph is tried on when it is read
LARGEST_STATE = 256

INPUTS = ("members_deg", "way_mm", "measurement_deg", "variance", "sample_time", "parts")
"""Inputs of the graph beside its state."""
STATE = ("mean", "covariance", "counts", "samples", "statistics")
OUTPUTS = ("bend_deg", "half_width_deg")
ALL_PARTS, RECOGNISER_ALONE, FILTER_ALONE = (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)
"""Parts of the graph that act, 1 or 0: the policy, and the recogniser of the noise."""


class TwinsState(NamedTuple):
    """State of B filters.

    Attributes:
        following: the members.
        memory: arrays of the graph, in the order of `STATE`.
        bend_deg: (B,) estimate [deg].
        half_width_deg: (B,) half of its 95 % interval [deg].
    """

    following: "Following"
    memory: tuple[Array32, ...]
    bend_deg: Array
    half_width_deg: Array


@dataclasses.dataclass(frozen=True)
class RamTwins(Estimator[TwinsState]):
    """A trained step, the twins that it predicts by, and what it is told.

    Attributes:
        network: the trained file.
        presets: of the members.
        sample_time: T, a multiple of the members' control period [s].
        measurement_variance: R, one for all or (B,) [deg^2].
        parts: whether the policy acts and the recogniser is heard, each 1 or 0.
    """

    network: TrainedFile
    presets: "tuple[Preset, ...]"
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
        from twin.preset.sample_time import check_sample_time

        check_sample_time(self.presets[0], sample_time)
        return dataclasses.replace(self, sample_time=sample_time)

    def start(self, pull_mm: Array, bend_deg: Array) -> TwinsState:
        """Return the state at the first sample; the initial estimate is given back there and not used."""
        batch = len(pull_mm)
        memory = tuple(np.zeros((batch, *shape), np.float32) for shape in self._shapes)
        return TwinsState(self._members.start(pull_mm), memory, bend_deg.copy(), np.full(batch, UNKNOWN_DEG))

    def resume(self, trusted: TwinsState, pull_mm: Array, bend_deg: Array) -> TwinsState:
        """Return the state of a stream that begins anew: d takes what it is off by, all else stays."""
        following = self._members.step(trusted.following, pull_mm)
        moved = (following.of_filters() - trusted.following.of_filters()).mean(axis=1)
        off = bend_deg - (trusted.bend_deg + moved)
        mean, covariance, *noise = (of.copy() for of in trusted.memory)
        begun = covariance.any(axis=(1, 2))  # a state of zeros is one that has seen nothing: it stays so
        mean[:, OF_ERROR] += off * begun
        covariance[:, OF_ERROR, OF_ERROR] += off**2 * begun
        return TwinsState(following, (mean, covariance, *noise), bend_deg.copy(), trusted.half_width_deg)

    def step(
        self, state: TwinsState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> TwinsState:
        """Step the members along the command, and the graph with what they say."""
        following = self._members.step(state.following, pull_mm)
        bend, half_width, *memory = self.network.run(
            members_deg=following.of_filters(),
            way_mm=np.abs(pull_mm - previous_pull_mm),
            measurement_deg=measurement_deg,
            variance=self._variance(len(pull_mm)),
            sample_time=np.full(len(pull_mm), self.sample_time),
            parts=np.array(self.parts),
            **dict(zip(STATE, state.memory, strict=True)),
        )
        return TwinsState(following, tuple(memory), bend.astype(float), half_width.astype(float))

    def bend_deg(self, state: TwinsState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @property
    def states_interval(self) -> bool:
        """True if it runs whole: without one of its parts, nobody has trained an interval."""
        return self.parts == ALL_PARTS

    def half_width_deg(self, state: TwinsState) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg]."""
        return state.half_width_deg

    @functools.cached_property
    def _members(self) -> "Members":
        from twin.reduced.following import Members

        return Members(self.presets, self.sample_time)

    @functools.cached_property
    def _shapes(self) -> tuple[tuple[int, ...], ...]:
        return state_shapes(self.network)

    def _variance(self, batch: int) -> Array:
        told = np.maximum(np.asarray(self.measurement_variance, dtype=float), LEAST_VARIANCE)
        return np.broadcast_to(told, batch)


def state_shapes(file: TrainedFile) -> tuple[tuple[int, ...], ...]:
    """Return the shape of each array of the state of one filter, as the graph of a trained file has it.

    Raises:
        ValueError: the graph has other inputs.
    """
    found = {part.name: tuple(part.shape) for part in file.session.get_inputs()}
    if set(found) != {*INPUTS, *STATE}:
        raise InputError(f"its inputs are {shown(list(found))}, not {', '.join((*INPUTS, *STATE))}")
    shapes = tuple(found[name][1:] for name in STATE)
    sizes = [size for shape in shapes for size in shape]
    if not all(isinstance(size, int) and 0 < size <= LARGEST_STATE for size in sizes):
        raise InputError(f"the shapes of its state are {shown(shapes)}")
    if [len(shape) for shape in shapes] != AXES or shapes[1] != shapes[0] * 2:
        raise InputError(f"the shapes of its state are {shown(shapes)}")
    return shapes


def load(path: Path) -> RamTwins:
    """Read a trained step and its members.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    from twin.reduced.following import members_from_dict

    file = read_trained_file(path, AGENT)
    try:
        presets = members_from_dict(file.description.get("members"))
        memory = {name: (BATCH, *shape) for name, shape in zip(STATE, state_shapes(file), strict=True)}
        inputs = dict.fromkeys(INPUTS, (BATCH,)) | {
            "members_deg": (BATCH, len(presets)),
            "parts": (len(ALL_PARTS),),
        }
        after = {f"{name}_after": shape for name, shape in memory.items()}
        outputs = dict.fromkeys(OUTPUTS, (BATCH,)) | after
        check_network(file, inputs | memory, outputs, positive=("variance", "sample_time"))
        return RamTwins(file, presets)
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {AGENT!r}: {error}") from error


def _build(known: Knowledge, parts: tuple[float, float] = ALL_PARTS) -> RamTwins:
    return dataclasses.replace(load(known.trained[AGENT]), sample_time=known.sample_time, parts=parts)


TRAINING = Training(
    AGENT, POLICY_FILE, load, "RAM on twins that follow the command, trained on simulated ones", on_twins=True
)
RAM_TWINS = register_method(
    MethodSpec(
        name="RAM (twins)",
        rank=58,
        family="learned",
        told="R",
        build=_build,
        training=TRAINING,
        beside_paper=True,
        style=Style("#a3195b", "solid", "*", 1.6),
    )
)
register_method(
    MethodSpec(
        name="RAM (twins), recogniser alone",
        rank=58.1,
        family="learned",
        told="R",
        build=lambda known: _build(known, RECOGNISER_ALONE),
        trained_as=AGENT,
    )
)
register_method(
    MethodSpec(
        name="RAM (twins), filter alone",
        rank=58.2,
        family="ensemble",
        told="R",
        build=lambda known: _build(known, FILTER_ALONE),
        trained_as=AGENT,
    )
)
