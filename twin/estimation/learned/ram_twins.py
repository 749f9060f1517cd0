"""RAM (twins): eq. 10 on an active model that predicts by reduced twins, with a classifier of the noise.

The M twins of the trained file follow the command; the complete step of filters, noise classifier and policy
is the graph of the file, the same that was trained (defined in `rl/twins/step.py`). No MuJoCo, no
torch.

A session starts from rest, or with an unknown history: then each member reaches the first pull by a path of
its own, and the measurements determine which members resemble the endoscope. The initial estimate is used
where its standard deviation is given.
"""

import dataclasses
import functools
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.methods import ON_TWINS, POLICY_FILE
from twin.estimation.learned.step import (
    ALL_PARTS,
    FILTER_ALONE,
    UNKNOWN_DEG,
    LearnedStep,
    Memory,
    StepNetwork,
    StepState,
    step_network,
)
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.member_motion import FIRST_ERROR_DEG2
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.files.shown import shown

if TYPE_CHECKING:  # twins are loaded when one is used: a table of methods needs none of them
    from twin.reduced.members import Following, Members, MemberSet

Array = NDArray[np.float64]
AGENT = "ram-twins"
STATE = ("mean", "covariance", "counts", "samples", "statistics", "rows", "rows_covariance", "evidence")
FARTHEST_DEG = 180.0  # of a measurement from the twins


@dataclasses.dataclass(frozen=True)
class RamTwins(LearnedStep):
    """A trained step and the twins that it predicts by."""

    twins: "MemberSet" = dataclasses.field(kw_only=True)  # that follow the command
    from_rest: bool = dataclasses.field(default=True, kw_only=True)  # whether a session starts at rest
    # standard deviation of the initial estimate [deg]; infinite: nothing is known of it
    initial_deviation_deg: float = dataclasses.field(default=np.inf, kw_only=True)

    def at(self, sample_time: float) -> Self:
        """Return the estimator for another T [s]."""
        return dataclasses.replace(self, sample_time=sample_time)

    def over(self, elapsed_s: float) -> Self:
        """Return the estimator of another T [s], with the same twins, at their control period."""
        other = dataclasses.replace(self, sample_time=elapsed_s)
        vars(other)["members"] = self.members
        return other

    def begun(self, from_rest: bool, initial_deviation_deg: float = np.inf) -> Self:
        """Return the estimator for sessions that start from rest, or with an unknown history."""
        return dataclasses.replace(self, from_rest=from_rest, initial_deviation_deg=initial_deviation_deg)

    def start(self, pull_mm: Array, bend_deg: Array) -> StepState:
        """Return the state at the first sample."""
        batch = len(pull_mm)
        memory = self.network.start(batch)
        following = self.members.start(pull_mm, from_rest=self.from_rest)
        if np.isfinite(self.initial_deviation_deg):
            memory = self._measured_first(memory, following.of_filters(), bend_deg)
        return StepState(memory, following, bend_deg.copy(), np.full(batch, UNKNOWN_DEG))

    def _measured_first(self, memory: Memory, members_deg: Array, bend_deg: Array) -> Memory:
        """Return the first state after the initial estimate, which is one measurement of the angle."""
        batch = len(members_deg)
        arrays = dict(zip(self.network.state, (of.copy() for of in memory), strict=True))
        middle = members_deg.mean(axis=1)
        angle = np.concatenate(
            [
                (members_deg - middle[:, None]) @ MemberWeights(self).directions,
                np.repeat([[1.0, 0.0]], batch, axis=0),  # of d and b
            ],
            axis=1,
        )
        first = np.ones_like(angle)
        first[:, -2] = FIRST_ERROR_DEG2
        first[:, -1] = np.broadcast_to(np.asarray(self.zero_deviation_deg, float) ** 2, batch)
        towards = first * angle
        variance = (angle * towards).sum(axis=1) + self.initial_deviation_deg**2
        moved = towards * ((bend_deg - middle) / variance)[:, None]
        covariance = first[:, :, None] * np.eye(first.shape[1])
        covariance = covariance - towards[:, :, None] * towards[:, None, :] / variance[:, None, None]
        arrays["mean"][:], arrays["rows"][:] = moved, moved[:, None]
        arrays["covariance"][:] = arrays["rows_covariance"][:] = covariance
        return tuple(arrays.values())

    def resume(self, trusted: StepState, now: StepState, pull_mm: Array, bend_deg: Array) -> StepState:
        """Return the state of a stream that starts again: d takes what it is off by, all else stays."""
        following = self.members.step(now.following, pull_mm)
        batch = len(pull_mm)
        inputs = self.constants(batch) | {
            "members_deg": following.of_filters(),
            "way_mm": np.zeros(batch),
            "measurement_deg": np.full(batch, np.nan),
        }
        predicted, _, after = self.network.step(trusted.memory, **inputs)
        memory = dict(zip(self.network.state, (of.copy() for of in after), strict=True))
        begun = trusted.memory[_COVARIANCES[0]].any(axis=(1, 2))  # a state of zeros has seen nothing
        off = (bend_deg - predicted) * begun
        memory["mean"][:, -2] += off  # c, d and b
        memory["covariance"][:, -2, -2] += off**2
        memory["rows"][:, :, -2] += off[:, None]
        memory["rows_covariance"][:, -2, -2] += off**2
        return StepState(tuple(memory.values()), following, bend_deg.copy(), trusted.half_width_deg)

    def twins_deg(self, state: StepState) -> Array:
        """Return the (B, M) angles of the twins [deg]."""
        angles: Array = state.following.of_filters()
        return angles

    def model_error_deg(self, state: StepState) -> tuple[float, float]:
        """Return the d of a state of one filter, by the likelihood of its noise models, and its deviation."""
        rows, evidence, covariance = (np.asarray(state.memory[place][0], float) for place in _OF_BANK)
        likely = np.exp(evidence - evidence.max())
        return float(likely @ rows[:, -2] / likely.sum()), float(np.sqrt(max(covariance[-2, -2], 0.0)))

    def follow(
        self, following: "Following", pull_mm: Array, previous_pull_mm: Array
    ) -> tuple[dict[str, Array], "Following"]:
        """Step the members along the command, and return their prediction."""
        after = self.members.step(following, pull_mm, self.sample_time)
        return {"members_deg": after.of_filters(), "way_mm": np.abs(pull_mm - previous_pull_mm)}, after

    def limited(self, following: "Following", measurement_deg: Array) -> Array:
        """Return measurements no farther than half a turn from all twins: others are no information."""
        members = following.of_filters()
        low, high = members.min(axis=1) - FARTHEST_DEG, members.max(axis=1) + FARTHEST_DEG
        limited: Array = np.clip(measurement_deg, low, high)
        return limited

    @property
    def has_physics(self) -> bool:
        """True: its members are twins."""
        return True

    @property
    def states_interval(self) -> bool:
        """True if all of it acts: without one of its parts, the interval is untrained."""
        return self.parts == ALL_PARTS

    @functools.cached_property
    def members(self) -> "Members":
        """The twins that follow the commands."""
        from twin.reduced.members import Members

        return Members(self.twins, self.sample_time)


_ROWS, _EVIDENCE = (STATE.index(name) for name in ("rows", "evidence"))
_OF_BANK = [STATE.index(name) for name in ("rows", "evidence", "rows_covariance")]
_COVARIANCES = [STATE.index(name) for name in ("covariance", "rows_covariance")]


class MemberWeights:
    """Weights of M members in the predicted angle, by the state of a filter.

    The graph predicts mean + (theta - mean) . D c + d of the members' angles theta, where c is the mean of
    the coefficients that its state has for each noise model, weighted by their likelihood. D and the prior of
    the noise models are constants inside of the graph. Without a measurement the graph returns its
    prediction, which is linear in theta, c and d: so they are read from its answers.
    """

    def __init__(self, estimator: RamTwins) -> None:
        models, size = estimator.network.state["rows"]
        members, directions = len(estimator.twins.presets), size - 2  # the last numbers are d and b
        coefficients = np.tile(np.eye(directions, size), (members, 1))
        one = np.repeat(np.eye(members), directions, axis=0)
        answers = _predicted(estimator, np.repeat(coefficients[:, None], models, axis=1), one)
        self.directions: Array = answers.reshape(members, directions) - 1 / members  # (M, r) D, centred
        of_error = np.zeros((models, models, size))
        of_error[range(models), range(models), -2] = 1.0
        self.log_prior: Array = np.log(_predicted(estimator, of_error, np.zeros((models, members))))  # (J,)

    def of(self, state: StepState) -> Array:
        """Return the (M,) weights of the one filter of a state; their sum is 1."""
        rows, evidence = (np.asarray(state.memory[place][0], float) for place in (_ROWS, _EVIDENCE))
        log_posterior = self.log_prior + evidence
        likely = np.exp(log_posterior - log_posterior.max())
        coefficients = likely @ rows[:, :-2] / likely.sum()
        weights: Array = 1 / len(self.directions) + self.directions @ coefficients
        return weights


def _predicted(estimator: RamTwins, rows: Array, members_deg: Array) -> Array:
    """Return (B,) angles that the graph predicts by rows (B, J, n) without a measurement [deg]."""
    batch = len(rows)
    memory = [of.copy() for of in estimator.network.start(batch)]
    # Any covariance that is not zero: a state of zeros would be taken for one that has not begun.
    for place in _COVARIANCES:
        memory[place][:] = np.eye(memory[place].shape[-1])
    memory[_ROWS][:] = rows
    inputs = estimator.constants(batch) | {
        "measurement_deg": np.full(batch, np.nan),
        "way_mm": np.zeros(batch),
    }
    bend, _, _ = estimator.network.step(tuple(memory), members_deg=members_deg, **inputs)
    return bend


def load(file: TrainedFile) -> RamTwins:
    """Return the estimator of a trained step and its members."""
    from twin.reduced.members import members_from_dict

    try:
        twins = members_from_dict(file.description.get("members"))
        network = step_network(file, {"members_deg": (len(twins.presets),), "way_mm": ()})
        shapes = network.state
        if set(shapes) != set(STATE):
            raise InputError(f"its state is {shown(list(shapes))}, not {', '.join(STATE)}")
        of_bank = (*shapes["evidence"], *shapes["rows_covariance"][:1])
        squares = all(shapes[name][:1] * 2 == shapes[name] for name in ("covariance", "rows_covariance"))
        if not squares or shapes["covariance"][:1] != shapes["mean"] or shapes["rows"] != of_bank:
            raise InputError(f"the shapes of its state are {shown(tuple(network.state.values()))}")
        return RamTwins(network, None, twins=twins)
    except ValueError as error:
        raise InputError(f"{file.path} is not a policy of the agent {AGENT!r}: {error}") from error


class UndetectedNetwork(StepNetwork):
    """The graph without its detector: no residual is counted, so that no noise is unknown."""

    def named(self, outputs: list[NDArray[Any]]) -> tuple[Array, Array | None, Memory]:
        """Return estimate, half width or None, and the state, whose histogram of residuals stays empty."""
        bend, half_width, memory = super().named(outputs)
        kept = zip(self.state, memory, strict=True)
        return bend, half_width, tuple(np.zeros_like(of) if name == "counts" else of for name, of in kept)


def _build(known: Knowledge, parts: tuple[float, float] = ALL_PARTS, *, detector_on: bool = True) -> RamTwins:
    estimator = load(read_trained_file(known.file_of(AGENT), AGENT))
    network = estimator.network if detector_on else UndetectedNetwork(**vars(estimator.network))
    return dataclasses.replace(estimator, network=network, sample_time=known.sample_time, parts=parts)


_GIVEN = (*ON_TWINS, "past")
TRAINING = Training(
    AGENT, POLICY_FILE, load, "RAM on twins that follow the command, trained on simulated ones", on_twins=True
)
RAM_TWINS = register_method(MethodSpec("RAM (twins)", _build, _GIVEN, training=TRAINING))
for _name, _part in (
    ("filter alone", functools.partial(_build, parts=FILTER_ALONE)),
    ("filter and classifier", functools.partial(_build, detector_on=False)),
):
    register_method(MethodSpec(f"{RAM_TWINS.name}, {_name}", _part, _GIVEN, trained_as=AGENT))
