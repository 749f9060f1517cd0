"""Results of the gate: checks that hold, do not hold or show nothing, and the verdict that follows."""

import functools
import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from twin.gate.evidence import GateMaterial

    MakeCheck = Callable[[GateMaterial], "Check"]

GO, NO_GO = "go", "no-go"
IDENTITY, TWIN, ACCURACY, CALIBRATION, SAFETY = PARTS = (
    "Identity of the policy",
    "Relevance of the twin",
    "Accuracy",
    "Calibration of the stated interval",
    "Safety of its running",
)
"""Parts of the argument, in their order."""
GIVE_LOGS = "Give logs of this endoscope: endotwin gate POLICY LOGS."
NOTHING = "Nothing."
Line = Annotated[str, Field(max_length=4000)]


class Check(BaseModel):
    """Result of one check: a figure against its bar."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    said: Line  # result in one sentence; it is the reason where the check does not hold
    figure: float | None = None  # what was measured; None where nothing could be
    bar: float | None = None  # limit of the figure; None where there is none
    relation: Line = "at most"  # `at most`, `at least` or `equal`: how the figure must relate to the bar
    unit: Line = ""  # of both
    holds: bool | None = None  # whether it does; None where the check showed nothing
    required: bool = True  # whether a go needs it: what is required and shows nothing is a no-go
    # evidence, one row of a table each
    rows: Annotated[tuple[dict[str, Any], ...], Field(max_length=10_000)] = ()
    notes: Annotated[tuple[Line, ...], Field(max_length=1000)] = ()  # basis and limits of the evidence
    name: Line = ""  # of the check; its declaration sets it
    # what the user can do where the check does not hold; that of its declaration, if it has no other
    remedy: Line = ""
    # only for the page: name, pull [mm], angle [deg] and what is compared with it [deg]
    curves: Annotated[tuple[Any, ...], Field(exclude=True)] = ()

    @property
    def passes(self) -> bool:
        """True where nothing of it prevents a go."""
        return bool(self.holds) or (self.holds is None and not self.required)

    @property
    def word(self) -> str:
        """The result in a word or two."""
        return {True: "holds", False: "does not hold", None: "not shown"}[self.holds]


class GateVerdict(BaseModel):
    """Go or no-go, and why."""

    model_config = ConfigDict(frozen=True)

    checks: Annotated[tuple[Check, ...], Field(min_length=1, max_length=100)]  # in the order of the table
    subject: dict[Line, Any]  # what was judged: policy, preset, logs, seed and versions, as plain values

    @property
    def go(self) -> bool:
        """True where every check passes."""
        return all(check.passes for check in self.checks)

    @property
    def word(self) -> str:
        """`go` or `no-go`."""
        return GO if self.go else NO_GO

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons of a no-go, or the basis of a go."""
        if self.go:
            held = sum(check.holds is True for check in self.checks)
            unknown = [check.name for check in self.checks if check.holds is None]
            first = f"{held} of {len(self.checks)} checks hold, none fails"
            return (first, *(f"not shown: {name}" for name in unknown))
        return tuple(
            f"{check.name}: {check.said}. {check.remedy}".rstrip()
            for check in self.checks
            if not check.passes
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of `gate.json`; no number is infinite or NaN."""
        values: dict[str, Any] = json.loads(self.model_dump_json())
        return {"verdict": self.word, "reasons": list(self.reasons), **values}


def none_of(failed: Sequence[Any], good: str, bad: str, unit: str, **evidence: Any) -> Check:
    """Return the result of a check that holds where nothing has failed; `good` or `bad` is the sentence."""
    count = float(len(failed))
    said = bad if failed else good
    return Check(said=said, figure=count, bar=0.0, relation="equal", unit=unit, holds=not failed, **evidence)


def not_shown(why: str, remedy: str) -> Check:
    """Return the result of a check that could show nothing, and that a go does not need."""
    return Check(said=why, required=False, remedy=remedy)


class CheckSpec(NamedTuple):
    """Declaration of one check: its name, part of the argument, remedy and share of the gate's time.

    A go claims the first line of the function's docstring.
    """

    name: str
    part: str
    remedy: str
    cost: float
    run: "MakeCheck"

    @property
    def claim(self) -> str:
        """What a go claims by it."""
        return (self.run.__doc__ or "").splitlines()[0]


DECLARED: list[CheckSpec] = []


def declare(name: str, part: str, remedy: str, cost: float = 1.0) -> "Callable[[MakeCheck], MakeCheck]":
    """Declare a function as a check; the remedy is stated where it does not hold."""

    def declared(make: "MakeCheck") -> "MakeCheck":
        @functools.wraps(make)
        def run(material: "GateMaterial") -> Check:
            check = make(material)
            stated = "" if check.holds else check.remedy or remedy
            return check.model_copy(update={"name": name, "remedy": stated})

        DECLARED.append(CheckSpec(name, part, remedy, cost, run))
        return run

    return declared
