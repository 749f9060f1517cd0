"""The gate's page: one self-contained HTML file that argues why a policy may be deployed, or may not.

Its order is that of an assurance argument (AMLAS; Hawkins et al. 2021): question and context, claims,
evidence, and what was not shown. Evidence is weighed by what is at risk as in ASME V&V 40 (2018).
"""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json, validated
from twin.files.origin import Origin, stated_origin
from twin.files.shown import shown
from twin.gate.accuracy import LEAST_COVERAGE
from twin.gate.check import ACCURACY, NOTHING, PARTS, Check, CheckSpec, GateVerdict
from twin.gate.run import CHECKS
from twin.report.figures import INK, MUTED, clean_axes
from twin.report.page import (
    Cell,
    Page,
    bullets,
    commands,
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
    "filter was given the right one.",
    "Twins are quasi-static and know no gravity; what is in no twin and in no log, such as contact with "
    "tissue, was not tried.",
    "Runs last seconds to minutes: hours of wear, heat and drift were not.",
    "The network was tried on drawn inputs, and only its gains are bounded by construction.",
    "Reference steps show damage, not intent: the file is not signed.",
    "What a wrong angle costs is not known here. The bars are those of this project; a use with grave "
    "consequences needs bars, and evidence, of its own.",
)
"""Limits of every run of the gate."""
CONTEXT = {
    "Question of interest": "May this policy estimate the bending angle of this endoscope in place of the "
    "tuned filter that would do so without it?",
    "Context of use": "It runs inside the runtime, sample by sample, with a trusted fallback, and is given "
    "the variance of its sensor. It gets the commanded pull and the measured angle; nothing else.",
    "Weight of the evidence": "The fallback takes over where the policy is not trusted, so that a bad "
    "estimate costs what the fallback's would, as long as it is noticed. Evidence is therefore needed in "
    "three places: that the policy is worth its risk, that the interval it states is right, and that faults "
    "are noticed.",
}
GOOD, BAD, LINE = "#2f5d8a", "#b3261e", "#a9b1ba"
_MARKS = ("o", "s", "^")


def read_gate_page(path: Path) -> Page:
    """Return the page of a `gate.json`; raises `ValueError` if it is another file."""
    values = read_json(path, 16 * MEBIBYTE)
    try:
        verdict = validated(GateVerdict, values)
        if values.get("verdict") != verdict.word:
            raise InputError(f"verdict = {shown(values.get('verdict'))}: its checks lead to {verdict.word}")
        return gate_page(verdict, stated_origin(values), str(path.with_suffix(".html")))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not what `endotwin gate` wrote: {error}") from error


def gate_page(verdict: GateVerdict, origin: Origin | None, out: str) -> Page:
    """Return the page of a verdict; `out` is its path, for the command that repeats it."""
    subject = verdict.subject
    intro = [text(_answer(verdict), "headline")]
    if subject.get("quick"):
        intro.append(text("This was a quick run, with fewer twins, draws and samples.", "gap"))
    intro += _next_steps(verdict, origin)
    page = Page(
        "EndoTwin gate: may this policy be deployed on this endoscope?",
        f"{'/'.join(Path(subject['policy']).parts[-2:])} on {subject['preset']}",
        verb="gate",
        verdict=verdict.word,
        intro=tuple(intro),
    )
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
    context = [text(Markup("<strong>{}.</strong> {}").format(*entry)) for entry in CONTEXT.items()]
    page.add("Question and context", *context, facts({"What was judged": judged}))
    specs = {spec.name: spec for spec in CHECKS}
    for part in PARTS:
        checks = [(specs[of.name], of) for of in verdict.checks if specs[of.name].part == part]
        page.add(part, _table(checks), *_figures(part, [check for _, check in checks]), *_rows(checks))
    page.add("What was not shown", text("In any run:"), bullets(LIMITS))
    page.add_origin(origin_command(origin, out), origin_facts(origin))
    return page


def _answer(verdict: GateVerdict) -> str:
    of, against = len(verdict.checks), sum(not check.passes for check in verdict.checks)
    if verdict.go:
        held = sum(check.holds is True for check in verdict.checks)
        return f"{held} of {of} checks hold, none speaks against."
    return f"Do not deploy it yet: {against} of {of} checks {'speaks' if against == 1 else 'speak'} against."


def _next_steps(verdict: GateVerdict, origin: Origin | None) -> list[Markup]:
    """Return what to do about every check that does not hold or shows nothing, and the command after that."""
    rows = [
        (check.name, _mark(check), check.said, check.remedy or "-")
        for check in sorted(verdict.checks, key=lambda check: check.passes)
        if not check.holds and check.remedy != NOTHING
    ]
    policy = shlex.quote(verdict.subject["policy"])
    run = commands([f"endotwin run --policy {policy} --out live.mcap < bench.jsonl > readings.jsonl"])
    again = commands([origin.command if origin else f"endotwin gate {policy}"])
    steps = [table(("check", "result", "why", "what to do"), rows, cards=True)] if rows else []
    return [*steps, *((text("Then run it:"), run) if verdict.go else (text("Then judge it again:"), again))]


def _mark(check: Check) -> Cell:
    return Cell(check.word, (), {True: "mark yes", False: "mark no", None: "mark open"}[check.holds])


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    return (f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}").replace("-", "\N{MINUS SIGN}")


def _table(checks: Sequence[tuple[CheckSpec, Check]]) -> Markup:
    if not checks:
        return gap("No check of this part was made.")
    rows = [
        (
            spec.claim,
            _mark(check),
            Cell(check.said, check.notes),
            _shown(check.figure),
            "-" if check.bar is None else f"{check.relation} {_shown(check.bar)} {check.unit}".strip(),
        )
        for spec, check in checks
    ]
    return table(("claim", "result", "evidence", "figure", "bar"), rows, cards=True)


def _rows(checks: Sequence[tuple[CheckSpec, Check]]) -> list[Markup]:
    return [
        folded(
            f"{check.name}: all figures",
            table(
                [name.replace("_", " ") for name in check.rows[0]],
                [[_shown(value) for value in row.values()] for row in check.rows],
                cards=len(check.rows[0]) > 4,
            ),
        )
        for _, check in checks
        if check.rows
    ]


def _figures(part: str, checks: Sequence[Check]) -> list[Markup]:
    with_rows = [check for check in checks if check.rows]
    if part == ACCURACY and with_rows:
        caption = (
            "Paired differences of the RMSE with 95 % intervals. The rival is the tuned active model; for "
            "the worth of what was learned it is the policy's own filter. Red crosses: it may be worse."
        )
        return [figure(difference_figure(with_rows), caption)]
    found = []
    for check in with_rows:
        if "inside" in check.rows[0]:
            caption = (
                "Coverage of the truth by the stated 95 % interval. Lines: 95 % intervals of the coverage. "
                "Red: the bar. Dashed: as stated."
            )
            found.append(figure(coverage_figure(check), caption))
        if "fallback_deg" in check.rows[0]:
            caption = "Errors during a fault and shortly after, and the trusted filter's on the same stream."
            found.append(figure(fault_figure(check), caption))
        if check.curves:
            caption = "Logs, and the response of the preset's twin to their commands; it sees no measurement."
            found.append(figure(twin_figure(check), caption))
    return found


def difference_figure(checks: Sequence[Check]) -> Figure:
    """Draw paired differences with their 95 % intervals, in percent of the rival's RMSE."""
    count = sum(len(check.rows) for check in checks)
    drawn = Figure(figsize=(7.6, 0.24 * count + 0.34 * len(checks) + 0.9), layout="constrained")
    axes = clean_axes(drawn.subplots())
    transform, place = axes.get_yaxis_transform(), 0.0
    ticks: dict[float, str] = {}
    for check in checks:
        axes.text(0.0, place, check.name, transform=transform, fontsize=9, fontweight="bold", va="center")
        place += 1
        for row in check.rows:
            scale = 100 / max(row["rival_deg"], 1e-9)
            low, middle, high = (row[name] * scale for name in ("low_deg", "difference_deg", "high_deg"))
            colour = GOOD if high <= 0 else BAD
            axes.plot([low, high], [place, place], color=colour, linewidth=1.6)
            axes.plot(middle, place, "o" if high <= 0 else "X", color=colour, markersize=5)
            ticks[place] = row["what"]
            place += 1
        place += 0.4
    axes.axvline(0, color=INK, linewidth=1)
    axes.set_yticks(list(ticks), list(ticks.values()))
    axes.set_ylim(place, -0.8)
    axes.grid(False, axis="y")
    axes.set_xlabel("RMSE of the policy minus that of the rival [% of the rival's]; left of 0 is better")
    return drawn


def coverage_figure(check: Check) -> Figure:
    """Draw the coverage of the 95 % interval under each noise, on each set of runs."""
    noises, bar = list(dict.fromkeys(row["what"] for row in check.rows)), 100 * LEAST_COVERAGE
    drawn = Figure(figsize=(7.6, 2.9), layout="constrained")
    axes = clean_axes(drawn.subplots())
    for number, name in enumerate(dict.fromkeys(row["set"] for row in check.rows)):
        rows = [row for row in check.rows if row["set"] == name]
        places = [noises.index(row["what"]) + 0.16 * (number - 1) for row in rows]
        face = "white" if number == 1 else GOOD
        shares = [100 * row["inside"] for row in rows]
        low, high = ([100 * row[end] for row in rows] for end in ("low", "high"))
        axes.vlines(places, low, high, color=GOOD, linewidth=1)
        axes.plot(places, shares, _MARKS[number % 3], label=name, color=GOOD, markerfacecolor=face)
    axes.axhline(95, color=LINE, linewidth=1, linestyle=(0, (4, 2)))
    axes.axhline(bar, color=BAD, linewidth=1)
    axes.text(len(noises) - 0.5, bar, "bar", color=BAD, fontsize=8.5, va="bottom", ha="right")
    axes.text(len(noises) - 0.5, 95, "stated", color=MUTED, fontsize=8.5, va="bottom", ha="right")
    axes.set_xticks(range(len(noises)), [name.replace(", ", "\n") for name in noises])
    axes.set_xlim(-0.5, len(noises) - 0.45)
    axes.set_ylabel("truth in the interval [%]")
    drawn.legend(frameon=False, fontsize=8.5, loc="outside upper left", ncols=3)
    return drawn


def fault_figure(check: Check) -> Figure:
    """Draw errors under each fault, of the policy in its runtime and of the trusted filter alone."""
    drawn = Figure(figsize=(7.6, 0.3 * len(check.rows) + 1.1), layout="constrained")
    axes = clean_axes(drawn.subplots())
    for place, row in enumerate(check.rows):
        colour = GOOD if row["ratio"] <= (check.bar or np.inf) else BAD
        axes.plot([row["fallback_deg"], row["rmse_deg"]], [place, place], color=LINE, linewidth=1.2)
        axes.plot(row["fallback_deg"], place, "s", color=MUTED, markersize=5.5, markerfacecolor="white")
        axes.plot(row["rmse_deg"], place, "o", color=colour, markersize=5.5)
    axes.set_yticks(range(len(check.rows)), [row["fault"] for row in check.rows])
    axes.set_ylim(len(check.rows) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("RMSE while the fault lasts and shortly after [deg]")
    handles = [
        Line2D([], [], marker=marker, color=colour, markerfacecolor=face, linestyle="", label=label)
        for marker, colour, face, label in (
            ("o", GOOD, GOOD, "policy in its runtime"),
            ("s", MUTED, "white", "trusted filter alone"),
        )
    ]
    drawn.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False, fontsize=8.5)
    return drawn


def twin_figure(check: Check) -> Figure:
    """Draw logs and the response of the twin to their commands alone."""
    drawn = Figure(figsize=(3.8 * len(check.curves), 3.3), layout="constrained")
    grid = np.atleast_1d(drawn.subplots(1, len(check.curves)))
    for axes, (name, pull, bend, predicted) in zip(grid, check.curves, strict=True):
        clean_axes(axes)
        axes.plot(pull, bend, color=LINE, linewidth=2.2, label="log")
        axes.plot(pull, predicted, color=BAD, linewidth=0.9, linestyle=(0, (4, 1.5)), label="twin, open loop")
        axes.set_title(name, fontsize=9, color=MUTED, loc="left")
        axes.set_xlabel("pulling distance [mm]")
    grid[0].set_ylabel("bending angle [deg]")
    grid[0].legend(frameon=False, fontsize=8.5)
    return drawn
