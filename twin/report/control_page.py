"""Page and figures of a comparison of controllers."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from twin.control.conditions import ControlCondition
from twin.control.controller import find_controllers
from twin.control.results import MORE, ControlResult
from twin.control.trial import HOLD_S, ControlTrial
from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json
from twin.files.origin import stated_origin
from twin.report import page as html
from twin.report.figures import INK, TRUTH, clean_axes, line_of, log_ticks
from twin.report.page import figure

LIMITS = (
    "Endoscopes and the members of RAM (twins) share their physics, but for the conditions that state "
    "otherwise; a real endoscope has more that no twin has.",
    "Every controller is given the sensor's variance R and its sample time.",
    "An oracle is given the endoscope itself: its remaining error is due to the speed of the motor and to a "
    "reference that is known one sample ahead.",
    "Motors follow their command within one limit of speed; their own dynamics are not modelled.",
)
"""Limits of every comparison."""
POSES = "poses.png"  # name of the figure that a picture of the endoscope is needed for
FIGURES = {
    POSES: "Where the endoscope under compensation and the one without it, pale, differ most.",
    "tracking.png": "One reference (dashed) under every controller on the first endoscope; error; command.",
    "loops.png": "Angle over the reference, without compensation and with it.",
    "errors.png": "Error of every endoscope, a dot each; bars are all trials together.",
}
"""Figures next to `control.json`, and what each shows."""

Total = Mapping[str, Any]  # errors of a controller under a condition, as `control.json` holds them


def read_control_page(path: Path) -> html.Page:
    """Return the page of a `control.json`, and of the figures in its folder."""
    values = read_json(path, 64 * MEBIBYTE)
    try:
        return control_page(values, path.parent)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise InputError(f"{path} is not what `endotwin control` wrote: {error}") from error


def control_page(values: Mapping[str, Any], folder: Path) -> html.Page:
    """Return the page of a comparison."""
    control, totals = values["control"], values["totals"]
    origin = stated_origin(values)
    files = {folder / name: caption for name, caption in FIGURES.items()}
    pictures = [figure(path, caption) for path, caption in files.items() if path.is_file()]
    first = [of for of in totals if of["condition"] == totals[0]["condition"]]
    endoscopes = f"{control['twins']} endoscope{'s' if control['twins'] > 1 else ''}"
    if control.get("test_set"):
        endoscopes += " in each sealed condition"
    page = html.Page(
        "EndoTwin control: following a bend in spite of the hysteresis",
        f"{control['preset']}, {endoscopes}",
        verb="control",
        intro=(_answer(first), *pictures[:1], _ranked(first, values["comparisons"])),
    )
    page.add(
        "What it looks like", *(pictures[1:] or [html.gap("There is no other figure with these results.")])
    )
    page.add("Errors under every condition", *_errors(totals))
    page.add(
        "How it was measured",
        html.facts({"": _facts(control)}),
        html.folded("Tuning", _tuned(values["tuned"])),
    )
    page.add("What was not shown", html.bullets(LIMITS))
    repeat = (*html.origin_command(origin, str(folder)), f"endotwin report {folder}")
    page.add_origin(repeat, html.origin_facts(origin))
    return page


def _place(of: Total) -> tuple[bool, float]:
    """Order of controllers: those that can be deployed, the least error first, then oracles."""
    return of["oracle"], float(of["rmse_deg"])


def _answer(totals: Sequence[Total]) -> Markup:
    racing = [of for of in sorted(totals, key=_place) if not of["oracle"]]
    if not racing:
        return html.text("No controller that can be deployed was compared.", "headline")
    sentence = f"{racing[0]['controller']} follows best: {racing[0]['rmse_deg']:.2f} deg (RMSE)"
    if len(racing) > 1:
        sentence += f", where the next, {racing[1]['controller']}, has {racing[1]['rmse_deg']:.2f}"
    return html.text(f"{sentence}.", "headline")


def _ranked(totals: Sequence[Total], comparisons: Sequence[Mapping[str, Any]]) -> Markup:
    condition = totals[0]["condition"]
    against = {of["rival"]: of for of in comparisons if of["condition"] == condition}
    rows = []
    for of in sorted(totals, key=_place):
        reduced = ("-", "-")
        if less := against.get(of["controller"]):
            low, high = (100 * end for end in less["reduction_ci95"])
            reduced = f"{100 * less['reduction']:.0f} %", f"{low:.0f} to {high:.0f} %"
        rows.append((of["controller"], f"{of['rmse_deg']:.2f}", f"{of['worst_twin_rmse_deg']:.2f}", *reduced))
    ours = next((of["controller"] for of in comparisons), "this project's own")
    head = ("controller", "RMSE [deg]", "worst endoscope [deg]", f"less error by {ours}", "95 % interval")
    note = (
        "The least error first; oracles, which are the limit, last. Paired: all met the same endoscopes, "
        "references and noise. Intervals by a jackknife over endoscopes."
    )
    return html.table(head, rows, title=condition, note=note, cards=True, numbers=True)


def _errors(totals: Sequence[Total]) -> Sequence[Markup]:
    conditions = list(dict.fromkeys(of["condition"] for of in totals))
    names = list(dict.fromkeys(of["controller"] for of in totals))
    cells = {(of["controller"], of["condition"]): of for of in totals}

    def by_condition(title: str, note: str, show: Callable[[Total], html.Cell | str]) -> Markup:
        rows = []
        for condition in conditions:
            row = [cells.get((name, condition)) for name in names]
            rows.append((condition, *("-" if of is None else show(of) for of in row)))
        head, cards = ("condition", *names), len(names) > 3
        return html.table(head, rows, title=title, note=note, cards=cards, numbers=True)

    def travel(of: Total) -> html.Cell:
        share = of["fallback_share"]
        return html.Cell(f"{of['travel_mm']:.0f}", (f"fallback {100 * share:.1f} %",) if share > 0 else ())

    return (
        by_condition(
            "Complete references",
            "RMSE of tracking [deg] of all trials; below it, that of the worst endoscope.",
            lambda of: html.Cell(f"{of['rmse_deg']:.2f}", (f"{of['worst_twin_rmse_deg']:.2f}",)),
        ),
        by_condition(
            "Last 20 s",
            "RMSE [deg], and below it the largest error. A disturbance is over two seconds before.",
            lambda of: html.Cell(f"{of['late_rmse_deg']:.2f}", (f"{of['late_worst_deg']:.1f}",)),
        ),
        by_condition(
            "Travel of the command",
            "Mean of a trial [mm]: it wears the sheath. Below it, the share of time under the fallback.",
            travel,
        ),
        *(
            by_condition(caption, "", partial(_number, name=name))
            for caption, name in MORE.items()
            if any(of.get(name) is not None for of in totals)
        ),
    )


def _number(of: Total, name: str) -> str:
    value = of.get(name)
    return "-" if value is None else f"{value:.1f}"


def _facts(control: Mapping[str, Any]) -> html.Facts:
    limits = control["limits"]
    spans = " or ".join(f"{of['low_mm']:g} to {of['high_mm']:g} mm" for of in limits)
    drawn = f"{control['twins']} drawn from the ranges of {control['preset']}, in {control['physics']}"
    return (
        ("endoscopes", drawn),
        ("references", f"{control['seconds']:g} s each, after a hold of 3 s that is not scored"),
        ("command", f"{spans}, at most {limits[0]['speed_mm_s']:g} mm/s"),
        ("delay of the sensor", f"{control['sensor_latency_s']:g} s"),
        ("reference known ahead", f"{control['preview_s']:g} s"),
        ("tuning", f"{control['candidates']} settings for each controller and sensor, on other endoscopes"),
        ("sealed test set", control.get("test_set") or "none"),
        ("SHA-256 of the trained file", control["policy_sha256"] or "none"),
        ("seed", f"{control['seed']}"),
        ("EndoTwin", str(control["version"])),
    )


def _tuned(tuned: Sequence[Mapping[str, Any]]) -> Markup:
    rows = []
    for of in tuned:
        found = (f"{name.replace('_', ' ')} {value:.3g}" for name, value in of["settings"].items())
        sensor = f"{of['noise_variance_deg2']:.3g}", f"{of['sample_time_s']:g}"
        settings = ", ".join(found) or "none"
        rows.append((of["controller"], *sensor, f"{of['tried']}", f"{of['rmse_deg']:.2f}", settings))
    error = "RMSE on the tuning's own, geometric mean [deg]"
    head = ("controller", "R [deg²]", "T [s]", "tried", error, "settings")
    return html.table(head, rows, title="What was tuned", cards=True)


def tracking_figure_of(shown: Mapping[str, ControlTrial], title: str) -> Figure:
    """Draw the bend under each controller over its error; all trials are along the same reference."""
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    grid = figure.subplots(3, 1, sharex=True, height_ratios=(1.5, 1, 1))
    angle, error, pull = (clean_axes(axes) for axes in grid)
    wanted = next(iter(shown.values()))
    time = np.arange(len(wanted.reference_deg)) * wanted.sample_time - HOLD_S
    for name, trial in shown.items():
        line = _line(name)
        angle.plot(time, trial.truth_deg, **line)
        error.plot(time, trial.truth_deg - trial.reference_deg, **line)
        pull.plot(time, trial.pull_mm, **line)
    angle.plot(time, wanted.reference_deg, **line_of(TRUTH))
    error.axhline(0, color=INK, linewidth=0.6)
    for axes in grid:
        axes.axvline(0, color="#b8bec6", linewidth=0.7)
    angle.set_title(title, loc="left", fontsize=10)
    angle.set(ylabel="bending angle [deg]")
    error.set(ylabel="error [deg]")
    pull.set(ylabel="command [mm]", xlabel="time since the hold at the start [s]", xlim=time[[0, -1]])
    handles = [Line2D([], [], label=name, **_line(name)) for name in shown]
    handles.append(Line2D([], [], label="reference", **line_of(TRUTH)))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8.5)
    return figure


def loop_comparison_figure(shown: Mapping[str, ControlTrial], before: str, after: str) -> Figure:
    """Draw the bend against the reference under two controllers: without compensation, and with it."""
    figure = Figure(figsize=(7.2, 3.5), layout="constrained")
    for axes, name in zip(figure.subplots(1, 2, sharex=True, sharey=True), (before, after), strict=True):
        trial = shown[name]
        wanted, bend = trial.reference_deg[trial.scored], trial.truth_deg[trial.scored]
        clean_axes(axes).plot(wanted, bend, **_line(name))
        ends = [wanted.min(), wanted.max()]
        axes.plot(ends, ends, color=INK, linewidth=0.7, linestyle=(0, (4, 2)))
        axes.set_title(f"{name}: {trial.rmse_deg:.2f} deg RMSE", loc="left", fontsize=9.5)
        axes.set_xlabel("reference angle [deg]")
        axes.set_aspect("equal")
    figure.axes[0].set_ylabel("bending angle [deg]")
    return figure


def control_errors_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the error of every controller under every condition: each twin a dot, all of them a bar."""
    conditions: list[ControlCondition] = list(dict.fromkeys(result.condition for result in results))
    names = list(dict.fromkeys(result.controller for result in results))
    apart = 0.8 / len(names)
    tall = 1.2 + 0.13 * (len(names) + 1) * len(conditions)
    figure = Figure(figsize=(8.0, max(tall, 2.6)), layout="constrained")
    axes = clean_axes(figure.subplots())
    for result in results:
        place = conditions.index(result.condition) + (names.index(result.controller) + 0.5) * apart - 0.4
        colour = _line(result.controller)["color"]
        twins = result.by_twin_deg
        across = np.full(len(twins), place)
        axes.plot(twins, across, "o", color=colour, markersize=2.8, alpha=0.55, markeredgewidth=0)
        axes.vlines(result.rmse_deg, place - 0.45 * apart, place + 0.45 * apart, color=colour, linewidth=2)
    for between in range(1, len(conditions)):
        axes.axhline(between - 0.5, color="#dfe3e8", linewidth=0.8)
    axes.grid(visible=False, axis="y")
    axes.set_xscale("log")
    axes.set_xlabel("tracking RMSE [deg]")
    axes.set_yticks(range(len(conditions)), [condition.name for condition in conditions], fontsize=8.5)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(conditions) - 0.5, -0.5)
    log_ticks(axes.xaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50))
    handles = [Line2D([], [], color=_line(name)["color"], linewidth=2, label=name) for name in names]
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8.5)
    return figure


def _line(name: str) -> dict[str, Any]:
    (spec,) = find_controllers([name])
    return line_of(spec.style)
