"""Page of a comparison of controllers: one self-contained HTML file, made of what `control.json` holds."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.files.atomic import write_whole
from twin.report.template import page_environment

LIMITS = (
    "Endoscopes and the members of RAM (twins) share their physics, but for the conditions that say "
    "otherwise; a real endoscope has more that no twin has.",
    "Every controller was told the sensor's variance R and its sample time.",
    "An oracle is told the endoscope itself: what it is off by is left over by the speed of the motor and by "
    "a reference that is known one sample ahead.",
    "Motors follow their command within one limit of speed; their own dynamics are not here.",
)
"""Limits of every comparison."""


def write_control_page(
    values: Mapping[str, Any], figures: Sequence[tuple[bytes, str]], path: Path, command: str
) -> Path:
    """Write the page, whole or not at all.

    Args:
        values: what `control.json` holds.
        figures: each a PNG file and its caption.
        path: the HTML file.
        command: that makes it again.
    """
    totals = values["totals"]
    first = totals[0]["condition"]
    page = (
        page_environment()
        .get_template("control.html.j2")
        .render(
            control=values["control"],
            headline=headline(values),
            names=list(dict.fromkeys(of["controller"] for of in totals)),
            conditions=_by_condition(totals),
            first=first,
            comparisons=[of for of in values["comparisons"] if of["condition"] == first],
            tuned=values["tuned"],
            figures=[
                {"source": f"data:image/png;base64,{base64.b64encode(png).decode()}", "caption": caption}
                for png, caption in figures
            ],
            limits=LIMITS,
            command=command,
        )
    )
    write_whole(path, page)
    return path


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


def _by_condition(totals: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Mapping[str, Any]]]:
    """Return the totals by condition and controller."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for of in totals:
        found.setdefault(of["condition"], {})[of["controller"]] = of
    return found
