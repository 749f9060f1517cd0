"""The page of a comparison of controllers, made of what `control.json` holds and the figures beside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json
from twin.files.origin import stated_origin
from twin.report.facts import origin_command, origin_groups
from twin.report.parts import (
    Cell,
    Facts,
    Lines,
    Page,
    Part,
    Picture,
    Section,
    Table,
    Text,
    png_picture,
    repeat_section,
)

LIMITS = (
    "Endoscopes and the members of RAM (twins) share their physics, but for the conditions that say "
    "otherwise; a real endoscope has more that no twin has.",
    "Every controller was told the sensor's variance R and its sample time.",
    "An oracle is told the endoscope itself: what it is off by is left over by the speed of the motor and by "
    "a reference that is known one sample ahead.",
    "Motors follow their command within one limit of speed; their own dynamics are not here.",
)
"""Limits of every comparison."""
POSES = "poses.png"
"""Name of the figure that a picture of the endoscope is needed for."""
FIGURES = {
    POSES: "Where the endoscope under compensation and the one without it, pale, differ most.",
    "tracking.png": "One reference (dashed) under every controller on the first endoscope; error; command.",
    "loops.png": "Angle over what was wanted, without compensation and with it.",
    "errors.png": "Error of every endoscope, a dot each; bars are all trials together.",
}
"""Figures beside `control.json`, and what each shows."""


def read_control_page(path: Path) -> Page:
    """Return the page of a `control.json`, and of the figures beside it.

    Raises:
        ValueError: it is no such file.
    """
    values = read_json(path, 64 * MEBIBYTE)
    try:
        return control_page(values, path.parent)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise InputError(f"{path} is not what `endotwin control` wrote: {error}") from error


def control_page(values: Mapping[str, Any], folder: Path) -> Page:
    """Return the page of a comparison.

    Args:
        values: what `control.json` holds.
        folder: where it and its figures are.
    """
    control, totals = values["control"], values["totals"]
    origin = stated_origin(values)
    figures: list[Picture] = []
    for name, caption in FIGURES.items():
        if (folder / name).is_file():
            figures.append(png_picture(folder / name, caption))
    seen: tuple[Part, ...] = tuple(figures) or (Text("There is no figure beside these results."),)
    sections = (
        Section("What it looks like", seen),
        Section("Errors", _errors(totals)),
        Section("Against the others", (_against(values["comparisons"], totals[0]["condition"]),)),
        Section(
            "How it was measured",
            (Facts((("", _facts(control)), *origin_groups(origin))), _tuned(values["tuned"])),
        ),
        Section("What was not shown", (Lines(LIMITS),)),
        repeat_section((*origin_command(origin, str(folder)), f"endotwin report {folder}")),
    )
    return Page(
        verb="control",
        kicker="EndoTwin control: following a bend in spite of the hysteresis",
        title=f"{control['preset']}, {control['twins']} endoscopes",
        headline=headline(values),
        sections=sections,
    )


def headline(values: Mapping[str, Any]) -> str:
    """Return what a reader should take away, in a sentence."""
    totals = values["totals"]
    first = [of for of in totals if of["condition"] == totals[0]["condition"]]
    limit = next((of for of in first if of["oracle"]), None)
    best = min((of for of in first if of is not limit) if len(first) > 1 else first, key=_error)
    said = (
        f"{best['controller']} follows references to {best['rmse_deg']:.2f} deg (RMSE) on "
        f"{values['control']['twins']} endoscopes that it was not tuned on, {best['condition']}"
    )
    if limit is not None and limit is not best:
        said += f" (the limit, by an oracle, is {limit['rmse_deg']:.2f} deg)"
    rivals = [of for of in first if of is not best and of is not limit]
    if not rivals:
        return f"{said}."
    rival, last = min(rivals, key=_error), max(rivals, key=_error)
    said = f"{said}: {_less(best, rival)} less error than {rival['controller']}, the next best"
    if last is rival:
        return f"{said}."
    return f"{said}, and {_less(best, last)} less than {last['controller']}, the last."


def _error(total: Mapping[str, Any]) -> float:
    return float(total["rmse_deg"])


def _less(best: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    return f"{1 - best['rmse_deg'] / max(other['rmse_deg'], 1e-9):.0%}"


def _errors(totals: Sequence[Mapping[str, Any]]) -> tuple[Part, ...]:
    """Return three tables with a row for each controller and a column for each condition."""
    conditions = list(dict.fromkeys(of["condition"] for of in totals))
    names = list(dict.fromkeys(of["controller"] for of in totals))
    cells = {(of["controller"], of["condition"]): of for of in totals}

    def table(title: str, note: str, figure: str, small: Any, places: int = 2) -> Table:
        rows = []
        for name in names:
            row: list[str | Cell] = [name]
            for condition in conditions:
                of = cells.get((name, condition))
                row.append("-" if of is None else Cell(f"{of[figure]:.{places}f}", small(of)))
            rows.append(tuple(row))
        cards = len(conditions) > 3
        return Table(("controller", *conditions), tuple(rows), title, note, cards, "numbers")

    return (
        table(
            "Whole references",
            "RMSE of tracking [deg] of all trials; below it, that of the worst endoscope.",
            "rmse_deg",
            lambda of: (f"{of['worst_twin_rmse_deg']:.2f}",),
        ),
        table(
            "Last 20 s",
            "RMSE [deg], and below it the largest error. A disturbance is over two seconds before.",
            "late_rmse_deg",
            lambda of: (f"{of['late_worst_deg']:.1f}",),
        ),
        table(
            "Way of the command",
            "Mean of a trial [mm]: it wears the sheath. Below it, the share of time in the fallback's hands.",
            "travel_mm",
            lambda of: (f"fallback {100 * of['fallback_share']:.1f} %",) if of["fallback_share"] > 0 else (),
            0,
        ),
    )


def _against(comparisons: Sequence[Mapping[str, Any]], first: str) -> Part:
    shown = [of for of in comparisons if of["condition"] == first]
    if not shown:
        return Text("No controller of this project's own was run.")
    rows = tuple(
        (
            of["rival"],
            f"{of['rival_rmse_deg']:.2f}",
            f"{100 * of['reduction']:.0f} %",
            "{:.0f} to {:.0f} %".format(*(100 * end for end in of["reduction_ci95"])),
        )
        for of in shown
    )
    note = (
        "Paired: all met the same endoscopes, references and noise. Intervals are by a bootstrap over "
        "endoscopes, and trials within each."
    )
    head = (first, "its RMSE [deg]", f"less error by {shown[0]['controller']}", "95 % interval")
    return Table(head, rows, note=note)


def _facts(control: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    limits = control["limits"]
    spans = " or ".join(f"{of['low_mm']:g} to {of['high_mm']:g} mm" for of in limits)
    return (
        (
            "endoscopes",
            f"{control['twins']} drawn from the ranges of {control['preset']}, in {control['physics']}",
        ),
        ("references", f"{control['seconds']:g} s each, behind a hold of 3 s that is not scored"),
        ("command", f"{spans}, at most {limits[0]['speed_mm_s']:g} mm/s"),
        ("delay of the sensor", f"{control['sensor_latency_s']:g} s"),
        ("reference known ahead", f"{control['preview_s']:g} s"),
        ("tuning", f"{control['candidates']} settings for each controller and sensor, on other endoscopes"),
        ("SHA-256 of the trained file", control["policy_sha256"] or "none"),
        ("seed", f"{control['seed']}"),
        ("EndoTwin", str(control["version"])),
    )


def _tuned(tuned: Sequence[Mapping[str, Any]]) -> Table:
    rows = tuple(
        (
            of["controller"],
            f"{of['noise_variance_deg2']:.3g}",
            f"{of['sample_time_s']:g}",
            f"{of['tried']}",
            f"{of['rmse_deg']:.2f}",
            ", ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in of["settings"].items())
            or "none",
        )
        for of in tuned
    )
    head = (
        "controller",
        "R [deg²]",
        "T [s]",
        "tried",
        "RMSE on the tuning's own, geometric mean [deg]",
        "settings",
    )
    return Table(head, rows, "What was tuned", cards=True)
