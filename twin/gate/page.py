"""The gate's page: one self-contained HTML file that argues why a policy may be deployed, or may not.

Its order is that of an assurance argument (AMLAS; Hawkins et al. 2021): question and context, claims,
evidence, and what was not shown. That evidence is weighed by what is at risk is of ASME V&V 40 (2018).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from markupsafe import Markup
from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json, validated
from twin.files.origin import Origin, stated_origin
from twin.gate.checks import accuracy, faults, honesty, sufficiency
from twin.gate.figures import coverage_figure, difference_figure, fault_figure, twin_figure
from twin.gate.result import Check, GateVerdict
from twin.gate.table import ACCURACY, CHECKS, HONESTY, PARTS, SAFETY, TWIN, CheckSpec
from twin.report.page import (
    Cell,
    Page,
    bullets,
    facts,
    figure,
    folded,
    gap,
    origin_command,
    origin_facts,
    table,
    text,
)

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
QUESTION = (
    "May this policy estimate the bending angle of this endoscope in place of the tuned filter that would do "
    "so without it?"
)
USE = (
    "It runs inside the runtime, sample by sample, beside a trusted fallback, and is told the variance of "
    "its sensor. It gets the commanded pull and the measured angle; nothing else."
)
WEIGHT = (
    "The fallback takes over where the policy is not trusted, so that a bad estimate costs what the "
    "fallback's would, as long as it is noticed. Evidence is therefore asked for in three places: that the "
    "policy is worth its risk, that what it says of its own error is true, and that faults are noticed."
)

Line = Annotated[str, Field(max_length=4000)]


class CheckFile(BaseModel):
    """A check as `gate.json` holds it.

    Attributes:
        name: of the check.
        said: what was found.
        figure: what was measured.
        bar: what it is held against.
        relation: how it must stand to it.
        unit: of both.
        holds: whether it does.
        required: whether a go needs it.
        rows: evidence.
        notes: what it rests on.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    name: Line
    said: Line
    figure: float | None
    bar: float | None
    relation: Line
    unit: Line
    holds: bool | None
    required: bool
    rows: Annotated[list[dict[Line, Any]], Field(max_length=10_000)]
    notes: Annotated[list[Line], Field(max_length=1000)]


class GateFile(BaseModel):
    """Contents of `gate.json`.

    Attributes:
        verdict: go or no-go.
        checks: results.
        subject: what was judged.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    verdict: Literal["go", "no-go"]
    checks: Annotated[list[CheckFile], Field(min_length=1, max_length=100)]
    subject: dict[Line, Any]


def read_gate_page(path: Path) -> Page:
    """Return the page of a `gate.json`.

    Raises:
        ValueError: it is no such file.
    """
    values = read_json(path, 16 * MEBIBYTE)
    try:
        file = validated(GateFile, values)
        checks = tuple(_check(of) for of in file.checks)
        return gate_page(
            GateVerdict(checks, file.subject), stated_origin(values), str(path.with_suffix(".html"))
        )
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not what `endotwin gate` wrote: {error}") from error


def _check(of: CheckFile) -> Check:
    return Check(**of.model_dump() | {"rows": tuple(of.rows), "notes": tuple(of.notes)})


def gate_page(verdict: GateVerdict, origin: Origin | None, out: str) -> Page:
    """Return the page of a verdict.

    Args:
        verdict: of the gate.
        origin: command, versions and hashes.
        out: where the page lies, for the command that makes it again.
    """
    found = {check.name: check for check in verdict.checks}
    specs = {spec.name: spec for spec in CHECKS}
    words = [check.word for check in verdict.checks]
    counts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    intro = [text(f"{len(words)} checks: {counts}."), bullets(verdict.reasons)]
    if verdict.subject.get("quick"):
        intro.append(text("This was a quick run, with fewer twins, draws and samples.", "gap"))
    page = Page(
        "EndoTwin gate: may this policy be deployed on this endoscope?",
        f"{verdict.subject['policy']} on {verdict.subject['preset']}",
        verb="gate",
        verdict=verdict.word,
        intro=tuple(intro),
    )
    page.add("Question and context", *_context(verdict.subject, origin))
    for part, claim in PARTS.items():
        made = [(specs[name], check) for name, check in found.items() if specs[name].part == part]
        page.add(part, _strong("Claim", claim, "claim"), _table(made), *_figures(part, found), *_rows(made))
    page.add("What was not shown", *_open(verdict))
    page.add_commands(origin_command(origin, out))
    return page


def shown_figure(value: float | None) -> str:
    """Return a figure of a check as people read it."""
    if value is None:
        return "-"
    said = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return said.replace("-", "\N{MINUS SIGN}")


def _context(subject: dict[str, Any], origin: Origin | None) -> list[Markup]:
    low, high = subject["stroke_mm"]
    logs = ", ".join(
        f"{log['name']} ({log['samples']} samples, {'measured' if log['measured'] else 'simulated'})"
        for log in subject["logs"]
    )
    judged = (
        ("policy", f"{subject['policy']} (agent {subject['agent']})"),
        ("SHA-256 of the policy", str(subject["sha256"])),
        ("endoscope", f"preset {subject['preset']}, pulled from {low:g} to {high:g} mm"),
        ("sample time", f"{subject['sample_time_s']:g} s"),
        ("logs", logs or "none given"),
        ("seed", f"{subject['seed']}, from random numbers that no training has"),
        ("EndoTwin", str(subject["version"])),
    )
    return [
        _strong("Question of interest", QUESTION),
        _strong("Context of use", USE),
        _strong("Weight of the evidence", WEIGHT),
        facts({"What was judged": judged, **origin_facts(origin)}),
    ]


def _strong(what: str, sentence: str, style: str = "") -> Markup:
    return text(Markup("<strong>{}.</strong> {}").format(what, sentence), style)


def _table(made: Sequence[tuple[CheckSpec, Check]]) -> Markup:
    if not made:
        return gap("No check of this part was made.")
    rows = []
    for spec, check in made:
        bar = "-" if check.bar is None else f"{check.relation} {shown_figure(check.bar)} {check.unit}".strip()
        style = {True: "mark yes", False: "mark no", None: "mark open"}[check.holds]
        rows.append(
            (
                Cell(spec.claim, (spec.question,)),
                Cell(check.word, (), style),
                Cell(check.said, check.notes),
                shown_figure(check.figure),
                bar,
            )
        )
    return table(("claim and question", "result", "evidence", "figure", "bar"), rows, cards=True)


def _rows(made: Sequence[tuple[CheckSpec, Check]]) -> list[Markup]:
    """Return all evidence of the checks, each behind a line that opens it."""
    return [
        folded(
            f"{check.name}: all figures",
            table(
                [name.replace("_", " ") for name in check.rows[0]],
                [[_shown(value) for value in row.values()] for row in check.rows],
                cards=len(check.rows[0]) > 4,
            ),
        )
        for _, check in made
        if check.rows
    ]


def _shown(value: Any) -> str:
    return shown_figure(value) if isinstance(value, float) else str(value)


def _open(verdict: GateVerdict) -> list[Markup]:
    unknown = tuple(f"{check.name}: {check.said}" for check in verdict.checks if check.holds is None)
    in_run = [text("In this run:"), bullets(unknown)] if unknown else []
    return [*in_run, text("In any run:"), bullets(LIMITS)]


def _figures(part: str, found: dict[str, Check]) -> list[Markup]:
    """Return the pictures of a part of the argument that there is evidence for."""
    pictures = []
    names = (accuracy.ON_TWINS, accuracy.ON_WIDER, accuracy.ON_LOGS, accuracy.LEARNING)
    compared = [found[name] for name in names if name in found and found[name].rows]
    if part == ACCURACY and compared:
        caption = (
            "Paired differences of the RMSE with 95 % intervals. The rival is the tuned active model; for "
            "the worth of what was learned it is the policy's own filter. Red crosses: being worse "
            "is not excluded."
        )
        pictures.append(figure(difference_figure(compared), caption))
    if part == HONESTY and honesty.COVERAGE in found and found[honesty.COVERAGE].rows:
        caption = "How often the stated 95 % interval holds the truth. Red: the bar. Dashed: what it states."
        drawn = coverage_figure(found[honesty.COVERAGE], honesty.LEAST_COVERAGE)
        pictures.append(figure(drawn, caption))
    if part == SAFETY and faults.ERRORS in found and found[faults.ERRORS].rows:
        caption = "Errors during a fault and shortly after, beside the trusted filter's on the same stream."
        pictures.append(figure(fault_figure(found[faults.ERRORS]), caption))
    if part == TWIN and sufficiency.SUFFICIENT in found and found[sufficiency.SUFFICIENT].curves:
        caption = "Logs, and what the preset's twin makes of their commands; it sees no measurement."
        pictures.append(figure(twin_figure(found[sufficiency.SUFFICIENT]), caption))
    return pictures
