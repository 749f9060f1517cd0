"""The page of a comparison of controllers, from `control.json` and the figures in its folder."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json
from twin.files.origin import stated_origin
from twin.report.page import (
    Cell,
    Facts,
    Page,
    bullets,
    facts,
    figure,
    gap,
    origin_command,
    origin_facts,
    table,
)

LIMITS = (
    "Endoscopes and the members of RAM (twins) share their physics, but for the conditions that state "
    "otherwise; a real endoscope has more that no twin has.",
    "Every controller is given the sensor's variance R and its sample time.",
    "An oracle is given the endoscope itself: its remaining error is due to the speed of the motor and to a "
    "reference that is known one sample ahead.",
    "Motors follow their command within one limit of speed; their own dynamics are not modelled.",
)
"""Limits of every comparison."""
POSES = "poses.png"
"""Name of the figure that a picture of the endoscope is needed for."""
FIGURES = {
    POSES: "Where the endoscope under compensation and the one without it, pale, differ most.",
    "tracking.png": "One reference (dashed) under every controller on the first endoscope; error; command.",
    "loops.png": "Angle over the reference, without compensation and with it.",
    "errors.png": "Error of every endoscope, a dot each; bars are all trials together.",
}
"""Figures next to `control.json`, and what each shows."""

Total = Mapping[str, Any]
"""Errors of a controller under a condition, as `control.json` holds them."""


def read_control_page(path: Path) -> Page:
    """Return the page of a `control.json`, and of the figures in its folder.

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
        values: contents of `control.json`.
        folder: of `control.json` and its figures.
    """
    control, totals = values["control"], values["totals"]
    origin = stated_origin(values)
    first = [of for of in totals if of["condition"] == totals[0]["condition"]]
    page = Page(
        "EndoTwin control: following a bend in spite of the hysteresis",
        f"{control['preset']}, {control['twins']} endoscopes",
        verb="control",
    )
    page.add("Controllers", _ranked(first, values["comparisons"]))
    shown = [figure(folder / name, caption) for name, caption in FIGURES.items() if (folder / name).is_file()]
    page.add("What it looks like", *(shown or [gap("There is no figure with these results.")]))
    page.add("Errors under every condition", *_errors(totals))
    stated = {"": _facts(control), **origin_facts(origin)}
    page.add("How it was measured", facts(stated), _tuned(values["tuned"]))
    page.add("What was not shown", bullets(LIMITS))
    page.add_commands((*origin_command(origin, str(folder)), f"endotwin report {folder}"))
    return page


def _ranked(totals: Sequence[Total], comparisons: Sequence[Mapping[str, Any]]) -> Markup:
    """Controllers under the first condition, the least error first, and paired reductions by our own."""
    condition = totals[0]["condition"]
    against = {of["rival"]: of for of in comparisons if of["condition"] == condition}
    rows = []
    for total in sorted(totals, key=lambda of: float(of["rmse_deg"])):
        less = against.get(total["controller"])
        rows.append(
            (
                total["controller"],
                f"{total['rmse_deg']:.2f}",
                f"{total['worst_twin_rmse_deg']:.2f}",
                "-" if less is None else f"{100 * less['reduction']:.0f} %",
                "-"
                if less is None
                else "{:.0f} to {:.0f} %".format(*(100 * end for end in less["reduction_ci95"])),
            )
        )
    ours = next((of["controller"] for of in comparisons), "this project's own")
    head = (
        "controller",
        "RMSE [deg]",
        "worst endoscope [deg]",
        f"less error by {ours}",
        "95 % interval",
    )
    note = (
        "The least error first; an oracle is the limit. Paired: all met the same endoscopes, references and "
        "noise. Intervals by a bootstrap over endoscopes, and trials within each."
    )
    return table(head, rows, title=condition, note=note, cards=True, numbers=True)


def _errors(totals: Sequence[Total]) -> Sequence[Markup]:
    """Three tables with a row for each controller and a column for each condition."""
    conditions = list(dict.fromkeys(of["condition"] for of in totals))
    names = list(dict.fromkeys(of["controller"] for of in totals))
    cells = {(of["controller"], of["condition"]): of for of in totals}

    def by_condition(title: str, note: str, show: Callable[[Total], Cell]) -> Markup:
        found = [[cells.get((name, condition)) for condition in conditions] for name in names]
        rows = [
            (name, *("-" if of is None else show(of) for of in row))
            for name, row in zip(names, found, strict=True)
        ]
        head, cards = ("controller", *conditions), len(conditions) > 3
        return table(head, rows, title=title, note=note, cards=cards, numbers=True)

    return (
        by_condition(
            "Whole references",
            "RMSE of tracking [deg] of all trials; below it, that of the worst endoscope.",
            lambda of: Cell(f"{of['rmse_deg']:.2f}", (f"{of['worst_twin_rmse_deg']:.2f}",)),
        ),
        by_condition(
            "Last 20 s",
            "RMSE [deg], and below it the largest error. A disturbance is over two seconds before.",
            lambda of: Cell(f"{of['late_rmse_deg']:.2f}", (f"{of['late_worst_deg']:.1f}",)),
        ),
        by_condition(
            "Travel of the command",
            "Mean of a trial [mm]: it wears the sheath. Below it, the share of time under the fallback.",
            lambda of: Cell(
                f"{of['travel_mm']:.0f}",
                (f"fallback {100 * of['fallback_share']:.1f} %",) if of["fallback_share"] > 0 else (),
            ),
        ),
    )


def _facts(control: Mapping[str, Any]) -> Facts:
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
        ("SHA-256 of the trained file", control["policy_sha256"] or "none"),
        ("seed", f"{control['seed']}"),
        ("EndoTwin", str(control["version"])),
    )


def _tuned(tuned: Sequence[Mapping[str, Any]]) -> Markup:
    rows = [
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
    ]
    error = "RMSE on the tuning's own, geometric mean [deg]"
    head = ("controller", "R [deg²]", "T [s]", "tried", error, "settings")
    return table(head, rows, title="What was tuned", cards=True)
