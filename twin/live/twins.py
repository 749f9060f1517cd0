"""Twins that follow the command of a live stream, for the check of the sensor where an estimator has none."""

import dataclasses
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator

if TYPE_CHECKING:  # twins are loaded when they are asked for
    from twin.estimation.learned.trained_file import TrainedFile
    from twin.preset import Preset, Ranges
    from twin.reduced.members import Following, Members

Array = NDArray[np.float64]
TWINS = 40
WIDER = 1.15  # times the ranges that the twins are drawn from: others lie between them
_SEED, _SECONDS = 1, 2.0


@dataclasses.dataclass(frozen=True)
class Twins(Estimator["Following"]):
    """Twins along the command; measurements are not used."""

    members: "Members"
    from_rest: bool
    elapsed_s: float | None = None  # that a step spans; T where none is given

    def over(self, elapsed_s: float) -> Self:
        """Return the twins whose step spans another time [s]."""
        return dataclasses.replace(self, elapsed_s=elapsed_s)

    def start(self, pull_mm: Array, bend_deg: Array) -> "Following":
        """Return the twins at the first pull."""
        return self.members.start(pull_mm, from_rest=self.from_rest)

    def step(
        self, state: "Following", pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> "Following":
        """Return the twins one sample later."""
        return self.members.step(state, pull_mm, self.elapsed_s)

    def resume(self, trusted: "Following", now: "Following", pull_mm: Array, bend_deg: Array) -> "Following":
        """Continue: a wrong sensor does not affect them."""
        return self.members.step(now, pull_mm)

    def bend_deg(self, state: "Following") -> Array:
        """Return the mean (B,) of the twins [deg]."""
        mean: Array = state.of_filters().mean(axis=1)
        return mean

    def twins_deg(self, state: "Following") -> Array:
        """Return the (B, M) angles of the twins [deg]."""
        return state.of_filters()


def twins_of(file: "TrainedFile") -> "tuple[Preset, Ranges] | None":
    """Return the endoscope and the ranges of the twins that a file was trained on; None without any."""
    if not {"preset", "ranges"} <= set(file.description):
        return None
    from twin.files.json_text import validated
    from twin.files.trained_schema import TwinsFile
    from twin.preset import Ranges
    from twin.preset.file import preset_of

    try:
        held = validated(TwinsFile, file.description)
        return preset_of("preset", held.preset), Ranges.from_dict(held.ranges)
    except ValueError as error:
        raise InputError(f"{file.path}: the twins of its training: {error}") from error


def draw_twins(
    preset: "Preset", ranges: "Ranges", stroke_mm: tuple[float, float], sample_time: float, from_rest: bool
) -> Twins:
    """Return twins of the ranges, for commands within a stroke [mm] every T [s]."""
    from twin.reduced import simulate_batch
    from twin.reduced.members import Members, MemberSet, check_members, draw_turns

    check_members([preset])
    rng = np.random.default_rng(_SEED)
    wider = ranges.wider(WIDER)
    drawn = [wider.draw(preset, rng) for _ in range(2 * TWINS)]
    there = np.linspace(0.0, stroke_mm[1] * 1e-3, round(_SECONDS / sample_time) + 2)
    found = simulate_batch(drawn, [there] * len(drawn), sample_time)
    able = [one for one, episode in zip(drawn, found, strict=True) if episode is not None][:TWINS]
    if len(able) < TWINS:
        found_able = f"{len(able)} of {len(drawn)} twins from its ranges can be simulated"
        raise InputError(f"{preset.name!r}: {found_able}: at least {TWINS} must")
    members = MemberSet.still(able)._replace(turns_mm=draw_turns(stroke_mm, TWINS, rng))
    return Twins(Members(members, sample_time), from_rest)
