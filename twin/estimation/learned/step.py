"""Learned estimators: the graph of a trained file is one complete sample of a filter.

A graph takes inputs and a state, and returns the estimate, half of its 95 % interval where it has one, and
the state after the sample. A state starts at zeros, apart from `previous_deg`, the estimate before, which
starts at the initial one, and from what the file lists under `start`.
"""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor, SingleForm, time_first
from twin.estimation.knowledge import Case
from twin.estimation.learned.reference import ESTIMATE, PREVIOUS, after
from twin.estimation.learned.trained_file import PRECISIONS, BoundFile, TrainedFile, check_network
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon, HysteresisModel, model_from_dict
from twin.preset.preset import ZERO_DEVIATION_DEG

Array = NDArray[np.float64]
Memory = tuple[NDArray[Any], ...]  # arrays of the state of B filters, (B, ...) each

SAMPLE_TIME = 0.1  # the paper's [s]
LEAST_VARIANCE = 1e-6  # least R [deg^2] that a graph is given: it divides by sqrt(R)
UNKNOWN_DEG = 180.0  # half of the interval before anything is measured [deg]
PARTS, START = "parts", "start"
"""Input that selects the parts that act; key of the numbers of a state that are not zero at the start."""
ALL_PARTS, FILTER_ALONE = (1.0, 1.0), (0.0, 0.0)
"""Parts of a graph that act, 1 or 0: the policy, and the noise classifier where there is one."""
_MEASURED = ("measurement_deg", "reference_deg", "variance", "zero_deviation_deg", "sample_time")
INPUTS: dict[str, tuple[int, ...]] = dict.fromkeys(("keep", "drive_deg", "increment_mm", *_MEASURED), ())
"""Inputs that a graph may take, with their shape for one filter: a step keep theta + drive of the model of
hysteresis, the increment of the pull, the measurement, the angle that a residual refers to (the measurement,
but the truth in an oracle run), R, the deviation of the sensor's zero and T. It may also take `parts`, which
all filters share."""
_BATCH = 2  # filters that a graph is tried on when it is read
_LARGEST_STATE = 4096


@dataclasses.dataclass(frozen=True)
class StepNetwork:
    """A graph of one sample."""

    file: TrainedFile
    inputs: tuple[str, ...]  # names of its inputs, without the state
    state: Mapping[str, tuple[int, ...]]  # shape of each array of the state of one filter, by name
    states_interval: bool  # whether it returns half of a 95 % interval
    first: Mapping[str, float] = dataclasses.field(default_factory=dict)  # numbers that do not start at zero

    def start(self, batch: int, bend_deg: Array | None = None) -> Memory:
        """Return the state before anything is measured, at (B,) initial estimates [deg]."""
        number = self.file.precision
        memory = {
            name: np.full((batch, *shape), self.first.get(name, 0.0), number)
            for name, shape in self.state.items()
        }
        if bend_deg is not None and PREVIOUS in memory:
            memory[PREVIOUS] = np.array(bend_deg, number)
        return tuple(memory.values())

    def step(self, memory: Memory, **inputs: NDArray[Any]) -> tuple[Array, Array | None, Memory]:
        """Return the (B,) estimate, half of its 95 % interval or None [deg], and the state after a sample."""
        given = {name: inputs[name] for name in self.inputs}
        return self.named(self.file.run(**given, **dict(zip(self.state, memory, strict=True))))

    def named(self, outputs: list[NDArray[Any]]) -> tuple[Array, Array | None, Memory]:
        """Return estimate, half width or None, and state from the outputs of the graph."""
        bend, *rest = outputs
        half_width = rest.pop(0) if self.states_interval else None
        return bend, half_width, tuple(bend if name == PREVIOUS else rest.pop(0) for name in self.state)


def step_network(file: TrainedFile, more: Mapping[str, tuple[int, ...]] | None = None) -> StepNetwork:
    """Return the graph of a trained file, tried on zeros."""
    known = INPUTS | dict(more or {})
    there = {part.name: tuple(part.shape) for part in file.session.get_inputs()}
    returned = [part.name for part in file.session.get_outputs()]
    shapes = {name: shape[1:] for name, shape in there.items() if after(name) in returned}
    inputs = tuple(name for name in there if name not in shapes)
    unknown = [name for name in inputs if name not in (*known, PARTS)]
    absent = [name for name in ("measurement_deg", *(more or {})) if name not in inputs]
    if unknown or absent:
        raise InputError(f"its inputs are {shown(list(there))}, not among {', '.join(known)}")
    sizes = [size for shape in shapes.values() for size in shape]
    if not all(isinstance(size, int) and 0 < size <= _LARGEST_STATE for size in sizes):
        raise InputError(f"the shapes of its state are {shown(tuple(shapes.values()))}")
    has_interval = "half_width_deg" in returned
    outputs = dict.fromkeys((ESTIMATE, "half_width_deg") if has_interval else (ESTIMATE,), (_BATCH,))
    memory = {name: (_BATCH, *shape) for name, shape in shapes.items()}
    tried = {name: (2,) if name == PARTS else (_BATCH, *known[name]) for name in inputs} | memory
    check_network(
        file,
        tried,
        outputs | {after(name): shape for name, shape in memory.items()},
        positive=("variance", "sample_time"),
        precisions=PRECISIONS,
    )
    first = file.description.get(START, {})
    if not (isinstance(first, dict) and all(isinstance(value, float) for value in first.values())):
        raise InputError(f"{START} = {shown(first)}: must be numbers by name")
    return StepNetwork(file, inputs, shapes, has_interval, first)


class StepState(NamedTuple):
    """State of B filters."""

    memory: Memory  # arrays of the graph, in the order of its state
    following: Any  # (m, B) memory of the model of hysteresis, or the twins that follow the command
    bend_deg: Array  # (B,) estimate [deg]
    half_width_deg: Array  # (B,) half of its 95 % interval [deg]; `UNKNOWN_DEG` where none is stated


@dataclasses.dataclass(frozen=True)
class LearnedStep(Estimator[StepState]):
    """A trained graph, the model that it predicts by, and its inputs."""

    network: StepNetwork  # graph of the trained file
    model: HysteresisModel | None  # of hysteresis, affine in the angle; None where the graph uses none
    sample_time: float = SAMPLE_TIME  # T [s]
    measurement_variance: ArrayLike | None = None  # R, one for all or (B,) [deg^2]; None until it is given
    # standard deviation of the sensor's zero, one for all or (B,) [deg]
    zero_deviation_deg: ArrayLike = ZERO_DEVIATION_DEG
    parts: tuple[float, float] = ALL_PARTS  # which parts act
    trained_at: float | None = None  # the only T that it runs at; None if it runs at any [s]

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator that takes the sensor's variance as R, and knows its zero that well."""
        return dataclasses.replace(
            self, measurement_variance=sensor.variance, zero_deviation_deg=sensor.zero_deviation_deg
        )

    def at(self, sample_time: float) -> Self:
        """Return the estimator for another T [s]; raises `ValueError` if it was trained for only one."""
        if self.trained_at is not None and abs(sample_time - self.trained_at) > 1e-9:
            raise InputError(
                f"sample_time = {sample_time:g}: {self.network.file.path} was trained at "
                f"{self.trained_at:g} s, and runs at no other"
            )
        return dataclasses.replace(self, sample_time=sample_time)

    def over(self, elapsed_s: float) -> Self:
        """Return the estimator of another T [s]; itself, if it was trained at only one T."""
        return self if self.trained_at is not None else dataclasses.replace(self, sample_time=elapsed_s)

    @functools.cached_property
    def _constants(self) -> dict[int, dict[str, Array]]:
        return {}

    def constants(self, batch: int) -> dict[str, Array]:
        """Return what B filters know of their sensors, T, and which parts act."""
        given = self.measurement_variance
        if given is None and "variance" in self.network.inputs:
            raise InputError("the sensor is not known: give it, `with_sensor(twin.Sensor(variance=...))`")
        if batch not in self._constants:
            variance = np.maximum(np.asarray(1.0 if given is None else given, dtype=float), LEAST_VARIANCE)
            self._constants[batch] = {
                "variance": np.array(np.broadcast_to(variance, batch)),
                "zero_deviation_deg": np.array(
                    np.broadcast_to(np.asarray(self.zero_deviation_deg, float), batch)
                ),
                "sample_time": np.full(batch, self.sample_time),
                PARTS: np.array(self.parts),
            }
        return self._constants[batch]

    def start(self, pull_mm: Array, bend_deg: Array) -> StepState:
        """Return the state at the first sample, at the initial estimates where the graph uses them."""
        memory = self.network.start(len(pull_mm), bend_deg)
        of_model = self.model.start(pull_mm) if self.model else np.zeros((0, len(pull_mm)))
        return StepState(memory, of_model, bend_deg.copy(), np.full(len(pull_mm), UNKNOWN_DEG))

    def step(
        self,
        state: StepState,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        reference_deg: Array | None = None,
    ) -> StepState:
        """Step the graph along the command; the residual refers to `reference_deg`, or the measurement."""
        inputs, following = self.follow(state.following, pull_mm, previous_pull_mm)
        measurement_deg = self.limited(following, measurement_deg)
        bend, half_width, memory = self.network.step(
            state.memory,
            **self.constants(len(pull_mm)),
            **inputs,
            measurement_deg=measurement_deg,
            reference_deg=measurement_deg if reference_deg is None else reference_deg,
        )
        return StepState(memory, following, bend, state.half_width_deg if half_width is None else half_width)

    def follow(self, following: Any, pull_mm: Array, previous_pull_mm: Array) -> tuple[dict[str, Array], Any]:
        """Return the inputs of the graph that follow from the command, and the model's memory after it."""
        inputs = {"increment_mm": pull_mm - previous_pull_mm}
        if self.model is not None:
            inputs["keep"], inputs["drive_deg"], following = affine_step(
                self.model, following, pull_mm, previous_pull_mm
            )
        return inputs, following

    def limited(self, following: Any, measurement_deg: Array) -> Array:
        """Return measurements (B,) [deg], limited to what the endoscope can do, where that is known."""
        return measurement_deg

    def single(self) -> SingleForm:
        """Return the estimator on one stream, on arrays of its own."""
        return LearnedForm(self) if isinstance(self.network.file, TrainedFile) else super().single()

    def bend_deg(self, state: StepState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @property
    def states_interval(self) -> bool:
        """Whether it states a 95 % interval with every estimate."""
        return self.network.states_interval

    def half_width_deg(self, state: StepState) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg]."""
        return state.half_width_deg


class LearnedForm(SingleForm):
    """A learned estimator on one stream, whose graph runs on arrays that stay where they are."""

    def __init__(self, estimator: LearnedStep):
        super().__init__(estimator)
        self._network = estimator.network
        self._learned = self._at = estimator  # as trained, and at the T of the last sample
        self._bound = BoundFile(estimator.network.file)
        for name, values in estimator.constants(1).items():
            if name in self._network.inputs:
                self._bound.inputs[name][...] = values
        given = [name for name in self._network.inputs if name not in estimator.constants(1)]
        self._given = [(name, self._bound.inputs[name]) for name in given]
        self._memory = [self._bound.inputs[name] for name in self._network.state]

    def step(
        self,
        state: StepState,
        pull_mm: float,
        previous_pull_mm: float,
        measurement_deg: float,
        elapsed_s: float | None = None,
    ) -> StepState:
        """Return the state one sample later; see `SingleForm.step`."""
        estimator = self._learned if elapsed_s is None else self._learned.over(elapsed_s)
        if estimator is not self._at:
            self._at = estimator
            if "sample_time" in self._network.inputs:
                self._bound.inputs["sample_time"][...] = estimator.sample_time
        with np.errstate(all="ignore"):  # what overflows is not sound
            inputs, following = estimator.follow(
                state.following, np.array([pull_mm]), np.array([previous_pull_mm])
            )
        measured = estimator.limited(following, np.array([measurement_deg]))
        for name, array in self._given:
            array[...] = inputs.get(name, measured)
        for array, values in zip(self._memory, state.memory, strict=True):
            array[...] = values
        bend, half_width, memory = self._network.named(self._bound.run())
        return StepState(memory, following, bend, state.half_width_deg if half_width is None else half_width)


@dataclasses.dataclass(frozen=True)
class OracleRun:
    """An estimator whose residual is taken from the clean truth: an oracle, which no robot can have."""

    estimator: LearnedStep

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg]; raises `ValueError` if the case has no truth."""
        if case.truth_deg is None:
            raise InputError("an oracle needs the truth")
        estimator = self.estimator.with_sensor(case.sensor)
        pull, measurement, initial = time_first(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        state = estimator.start(pull[0], initial)
        for k in range(1, len(measurement)):
            state = estimator.step(state, pull[k], pull[k - 1], measurement[k], case.truth_deg[:, k])
            estimate[k] = state.bend_deg
        return estimate.T


AnyStep = TypeVar("AnyStep", bound=LearnedStep)


def load_step(file: TrainedFile, kind: type[AnyStep]) -> AnyStep:
    """Return the estimator of a trained graph, with the model and the sample time of its training."""
    try:
        network = step_network(file)
        if "active_model" in file.description:
            of = ActiveModel.from_dict(file.description["active_model"])
            check_affine(of.model)
            return kind(network, of.model, of.sample_time, trained_at=of.sample_time)
        model = model_from_dict(file.description.get("model", {})) if "keep" in network.inputs else None
        return kind(network, model)
    except ValueError as error:
        raise InputError(f"{file.path} is no trained file of the agent {file.agent!r}: {error}") from error


def check_affine(model: HysteresisModel) -> None:
    """Refuse a model whose step is not affine in the angle: no graph can predict by it."""
    if not model.affine:
        raise InputError(
            f"the model {model.name!r} is not affine in the angle, as learned estimators need it; "
            "valid: 'coleman-hodgdon', 'prandtl-ishlinskii'"
        )


def affine_step(
    model: HysteresisModel, memory: Array, pull_mm: Array, previous_pull_mm: Array
) -> tuple[Array, Array, Array]:
    """Return keep and drive [deg] of a step keep theta + drive, and the memory of the model after it."""
    if pull_mm.size == 1 and isinstance(model, ColemanHodgdon):  # a stream: NumPy takes longer
        pull, increment = pull_mm.item(), pull_mm.item() - previous_pull_mm.item()
        a, b, c = (float(np.asarray(of)) for of in (model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm))
        forget = a * abs(increment)
        return np.array([1 - forget]), np.array([forget * b * pull + c * increment]), memory
    rest = np.zeros_like(pull_mm)
    drive, after = model.step(rest, memory, pull_mm, previous_pull_mm)
    return model.slope(rest, pull_mm, previous_pull_mm), drive, after


def affine_steps(model: HysteresisModel, pull_mm: Array) -> tuple[Array, Array]:
    """Return keep and drive, (records, N) each, of the steps keep theta + drive to each sample."""
    keep, drive = np.ones_like(pull_mm), np.zeros_like(pull_mm)
    memory = model.start(pull_mm[:, 0])
    for k in range(1, pull_mm.shape[1]):
        keep[:, k], drive[:, k], memory = affine_step(model, memory, pull_mm[:, k], pull_mm[:, k - 1])
    return keep, drive
