"""The gate's page: one self-contained HTML file that argues why a policy may be deployed, or may not.

Its order is that of an assurance argument (AMLAS; Hawkins et al. 2021): question and context, claims,
evidence, and what was not shown. That evidence is weighed by what is at risk is of ASME V&V 40 (2018).
"""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from twin.files.atomic import write_whole
from twin.gate.checks import accuracy, faults, honesty, sufficiency
from twin.gate.figures import coverage_figure, difference_figure, fault_figure, twin_figure
from twin.gate.result import Check, GateVerdict
from twin.gate.table import ACCURACY, CHECKS, HONESTY, PARTS, SAFETY, TWIN
from twin.report.figures import to_svg
from twin.report.template import page_environment

LIMITS = (
    "Noises of other kinds than those that are listed, and a variance R that is not the sensor's: every "
    "filter was told the right one.",
    "Twins are quasi-static and know no gravity; what is in no twin and in no log, such as contact with "
    "tissue, was not tried.",
    "Runs last seconds to minutes: hours of wear, heat and drift were not.",
    "The network was tried on inputs drawn by chance, and enclosed for its gains alone: it is not verified.",
    "Reference steps show damage, not intent: the file is not signed.",
    "What a wrong angle costs is not known here. The bars are those of this project; a use with grave "
    "consequences needs bars, and evidence, of its own.",
)
"""Limits of every run of the gate."""


def write_page(verdict: GateVerdict, path: Path, command: str) -> Path:
    """Write the page, whole or not at all.

    Args:
        verdict: of the gate.
        path: the HTML file.
        command: that makes it again.
    """
    found = {check.name: check for check in verdict.checks}
    specs = {spec.name: spec for spec in CHECKS}
    parts = [
        {
            "title": part,
            "claim": claim,
            "checks": [(specs[name], check) for name, check in found.items() if specs[name].part == part],
            "figures": _figures(part, found),
        }
        for part, claim in PARTS.items()
    ]
    page = (
        page_environment()
        .get_template("gate.html.j2")
        .render(
            verdict=verdict,
            subject=verdict.subject,
            parts=parts,
            unknown=[check for check in verdict.checks if check.holds is None],
            limits=LIMITS,
            command=command,
            shown=shown_figure,
        )
    )
    write_whole(path, page)
    return path


def shown_figure(value: float | None) -> str:
    """Return a figure of a check as people read it."""
    if value is None:
        return "-"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _figures(part: str, found: dict[str, Check]) -> list[dict[str, str]]:
    """Return the pictures of a part of the argument that there is evidence for."""
    drawn: list[dict[str, str]] = []

    def draw(figure: Callable[..., Figure], caption: str, *given: Any) -> None:
        source = base64.b64encode(to_svg(figure(*given)).encode()).decode()
        drawn.append({"source": f"data:image/svg+xml;base64,{source}", "caption": caption})

    names = (accuracy.ON_TWINS, accuracy.ON_WIDER, accuracy.ON_LOGS, accuracy.LEARNING)
    compared = [found[name] for name in names if name in found and found[name].rows]
    if part == ACCURACY and compared:
        caption = (
            "Paired differences of the RMSE with 95 % intervals. The rival is the tuned active model; for "
            "the worth of what was learned it is the policy's own filter. Red: being worse is not excluded."
        )
        draw(difference_figure, caption, compared)
    if part == HONESTY and honesty.COVERAGE in found and found[honesty.COVERAGE].rows:
        caption = "How often the stated 95 % interval holds the truth. Red: the bar. Dashed: what it states."
        draw(coverage_figure, caption, found[honesty.COVERAGE], honesty.LEAST_COVERAGE)
    if part == SAFETY and faults.ERRORS in found and found[faults.ERRORS].rows:
        caption = "Errors during a fault and shortly after, beside the trusted filter's on the same stream."
        draw(fault_figure, caption, found[faults.ERRORS])
    if part == TWIN and sufficiency.SUFFICIENT in found and found[sufficiency.SUFFICIENT].curves:
        caption = "Logs, and what the preset's twin makes of their commands; it sees no measurement."
        draw(twin_figure, caption, found[sufficiency.SUFFICIENT])
    return drawn
