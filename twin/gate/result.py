"""Results of the gate: checks that hold, do not hold or show nothing, and the verdict that follows."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

GO, NO_GO = "go", "no-go"
Array = NDArray[np.float64]
Curve = tuple[str, Array, Array, Array]


@dataclasses.dataclass(frozen=True)
class Check:
    """Result of one check: a figure against its bar.

    Attributes:
        name: of the check, as in the table of checks.
        said: what was found, in one sentence; it is the reason where the check does not hold.
        figure: what was measured; None where nothing could be.
        bar: what it is held against; None where there is no number to hold it against.
        relation: `at most`, `at least` or `equal`: how the figure must stand to the bar.
        unit: of both.
        holds: whether it does; None where the check showed nothing.
        required: whether a go needs it: what is required and shows nothing is a no-go.
        rows: evidence, one row of a table each.
        notes: what the evidence rests on, and what it does not say.
        curves: for the page alone: name, pull [mm], angle [deg] and what is compared with it [deg].
    """

    name: str
    said: str
    figure: float | None = None
    bar: float | None = None
    relation: str = "at most"
    unit: str = ""
    holds: bool | None = None
    required: bool = True
    rows: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()
    curves: tuple[Curve, ...] = ()

    @property
    def passes(self) -> bool:
        """True where nothing of it speaks against a go."""
        return bool(self.holds) or (self.holds is None and not self.required)

    @property
    def word(self) -> str:
        """The result in a word or two."""
        return {True: "holds", False: "does not hold", None: "not shown"}[self.holds]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `gate.json` holds them."""
        names = [field.name for field in dataclasses.fields(self) if field.name != "curves"]
        return {name: _plain(getattr(self, name)) for name in names}


@dataclasses.dataclass(frozen=True)
class GateVerdict:
    """Go or no-go, and why.

    Attributes:
        checks: in the order of the table.
        subject: what was judged: policy, preset, logs, seed and versions, as plain values.
    """

    checks: tuple[Check, ...]
    subject: dict[str, Any]

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
        """Reasons of a no-go, or what a go rests on."""
        if self.go:
            held = sum(check.holds is True for check in self.checks)
            open_ = [check.name for check in self.checks if check.holds is None]
            first = f"{held} of {len(self.checks)} checks hold, none fails"
            return (first, *(f"not shown: {name}" for name in open_))
        return tuple(f"{check.name}: {check.said}" for check in self.checks if not check.passes)

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of `gate.json`."""
        return {
            "verdict": self.word,
            "reasons": list(self.reasons),
            "checks": [check.to_dict() for check in self.checks],
            "subject": self.subject,
        }


def none_of(
    name: str,
    failed: Sequence[Any],
    good: str,
    bad: str,
    unit: str,
    *,
    rows: Sequence[dict[str, Any]] = (),
    notes: Sequence[str] = (),
) -> Check:
    """Return the result of a check that holds where nothing has failed; `good` or `bad` is then said."""
    holds = not failed
    return Check(
        name,
        good if holds else bad,
        figure=float(len(failed)),
        bar=0.0,
        relation="equal",
        unit=unit,
        holds=holds,
        rows=tuple(rows),
        notes=tuple(notes),
    )


def not_shown(name: str, why: str, *, required: bool = False, notes: Sequence[str] = ()) -> Check:
    """Return the result of a check that could show nothing."""
    return Check(name, why, required=required, notes=tuple(notes))


def _plain(value: Any) -> Any:
    """Return a value that JSON can hold: no number in it is infinite or NaN."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return value
