"""The table of methods: order, family, suites, place in the paper and style in figures of every estimator.

Tables and figures show methods in this order. The file of an estimator holds its mathematics and what it
needs (`twin.estimation.registry.MethodSpec`); how it is presented is a row here.
"""

import dataclasses
from typing import Any, Literal

Family = Literal["model", "filter", "set-membership filter", "tuned filter", "learned", "ensemble"]


@dataclasses.dataclass(frozen=True)
class Style:
    """Colour (`#rrggbb`), line style of matplotlib, and line width [points] in figures."""

    colour: str
    line: Any
    width: float = 1.1


@dataclasses.dataclass(frozen=True)
class Presentation:
    """Presentation of a method in comparisons."""

    family: Family  # kind of method
    in_paper_suite: bool = False  # whether the suite `paper` compares it
    on_request: bool = False  # the suite `full` compares it only where it is named or its file is given
    in_sealed_suite: bool = False  # whether the suite `sealed` compares it without its file
    in_paper_tables: bool = False  # whether the full suite shows it in the paper's tables too
    paper_column: int | None = None  # its column in the paper's Tables II and III, from the left, if any
    paper_figures: tuple[int, ...] = ()  # figures of the paper that show it
    proposed: bool = False  # whether it is the method that the paper proposes
    leading: bool = False  # this project's own method, which a report is about where it was compared
    is_limit: bool = False  # whether other methods are measured against it
    style: Style | None = None  # in figures; a grey one by its place where it has none of its own


def _paper(
    family: Family,
    style: Style | None = None,
    column: int | None = None,
    figures: tuple[int, ...] = (),
    **more: Any,
) -> Presentation:
    """Return the row of a method of the suite `paper`."""
    return Presentation(
        family,
        in_paper_suite=True,
        in_paper_tables=True,
        paper_column=column,
        paper_figures=figures,
        style=style,
        **more,
    )


_TRACKING = (6, 7, 8, 9, 10)
_ON_REQUEST = Presentation("learned", on_request=True)
_TUNED = Presentation("tuned filter", in_sealed_suite=True)
_TUNED_ON_REQUEST = Presentation("tuned filter", on_request=True, in_sealed_suite=True)

METHODS: dict[str, Presentation] = {
    "C-H": _paper("model", Style("#6f3fa0", (0, (6, 2, 1, 2))), 0, _TRACKING, in_sealed_suite=True),
    "C-H (monotone)": Presentation("model"),
    "Bouc-Wen": Presentation("model"),
    "P-I": Presentation("model"),
    "AM": _paper("filter", Style("#e2861b", (0, (5, 1.5))), 1, _TRACKING, in_sealed_suite=True),
    "KF": Presentation("filter"),
    "UKF": Presentation("filter"),
    "ESMF": Presentation("set-membership filter"),
    "ESMF (geometry)": Presentation("set-membership filter"),
    "AM-tuned": _paper("tuned filter", Style("#8a5a12", (0, (3, 1, 1, 1))), in_sealed_suite=True),
    "AM-tuned (Q, R)": _TUNED,
    "AM-tuned (Bouc-Wen)": _TUNED,
    "UKF-tuned (Bouc-Wen)": Presentation("tuned filter"),
    "AM-tuned (P-I)": _TUNED,
    "AM-tuned (twins)": _TUNED_ON_REQUEST,
    "AM-tuned (Bouc-Wen, twins)": _TUNED_ON_REQUEST,
    "PF-tuned": _TUNED,
    "PF-tuned (twins)": _TUNED_ON_REQUEST,
    "IMM": _TUNED_ON_REQUEST,
    "Huber": _TUNED,
    "VB": _TUNED,
    "AM with bias": _TUNED,
    "Koopman": _TUNED,
    "LSTM": _paper("learned", Style("#2f8f5b", (0, (1, 1)), 1.4), 2, _TRACKING),
    "GRU": Presentation("learned"),
    "KalmanNet": Presentation("learned", in_paper_tables=True),
    "Direct RL": _paper("learned", Style("#5f86b3", "-", 0.9), figures=(5,)),
    "RAM": _paper("learned", Style("#c4161c", "-", 1.5), 3, (5, *_TRACKING), proposed=True),
    "Constant gain": Presentation("tuned filter", in_paper_suite=True, in_sealed_suite=True),
    "RAM (oracle)": _paper("learned"),
    "Own agent": _ON_REQUEST,
    "LSTM (twins)": _ON_REQUEST,
    "GRU (twins)": _ON_REQUEST,
    "TCN (twins)": _ON_REQUEST,
    "SSM (twins)": _ON_REQUEST,
    "KalmanNet (twins)": _ON_REQUEST,
    "KalmanNet and bias (twins)": _ON_REQUEST,
    "Recursive KalmanNet (twins)": _ON_REQUEST,
    "RAM (memory)": Presentation("learned"),
    "RAM (twins)": Presentation(
        "learned", in_paper_tables=True, leading=True, style=Style("#14438b", "solid", 1.6)
    ),
    "RAM (twins), filter alone": Presentation("learned"),
    "RAM (twins), filter and classifier": _ON_REQUEST,
    "Ensemble": Presentation("ensemble", in_sealed_suite=True),
    "Ensemble with bias": Presentation("ensemble", on_request=True, in_sealed_suite=True),
    "Particles (families)": Presentation("ensemble", on_request=True),
    "Ensemble (limit)": Presentation("ensemble", is_limit=True),
    "Ensemble (limit, zero unknown)": Presentation("ensemble"),
    "Particles (limit)": Presentation("ensemble", on_request=True),
}
"""Every method of the package, in the order of tables."""

UNLISTED = Presentation("filter", in_paper_suite=True, in_sealed_suite=True)
"""Presentation of a method without a row, such as one of a method file: after all others, in every suite."""
