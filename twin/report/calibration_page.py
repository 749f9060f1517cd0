"""The page of a calibration: the errors of the twin on each log, next to those of models without physics."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from markupsafe import Markup
from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json, validated
from twin.files.origin import Origin, stated_origin
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml
from twin.report import page as html

FIT_END = "_fit.json"  # end of the name of the report of a calibrated preset
RIVALS = ("coleman_hodgdon", "prandtl_ishlinskii", "bouc_wen")
"""Models without physics that a calibration may be compared with, as its report names them."""
_CAPTION = (
    "Each log, and the twin driven by its command alone: it sees no measurement. Below, its errors and those "
    "of models without physics."
)

_NEARER = Markup(
    "A model without physics is nearer to the logs: search from more starts (<code>--starts 24</code>), fit "
    "more parameters (<code>--free</code>), and check the units of the logs and the bend of the sheath."
)
_OPEN = Markup(
    "The logs do not determine all parameters (see the warnings): add logs of larger strokes and of other "
    "bends of the sheath, or fit fewer parameters (<code>--free</code>)."
)
_UNPROVEN = Markup(
    "Nothing shows yet how far the fit carries: give a log that is only predicted (<code>--predict</code>), "
    "or fit a share of each (<code>--fraction 0.7</code>)."
)
WIDE = 3  # logs whose figure takes the width of the page

Name = Annotated[str, Field(max_length=200)]
Number = Annotated[float, Field(allow_inf_nan=False)]


class FittedParameter(BaseModel):
    """A fitted parameter in SI units; the deviation is None where the logs do not determine it."""

    model_config = ConfigDict(frozen=True)

    value: Number
    standard_deviation: Number | None


class FitFile(BaseModel):
    """Contents of `NAME_fit.json` that the page needs; `logs` are the errors on each log, by name."""

    model_config = ConfigDict(frozen=True)

    optimizer: Name
    seed: int
    logs: Annotated[list[dict[Name, str | Number | None]], Field(min_length=1, max_length=10_000)]
    parameters: Annotated[dict[Name, FittedParameter], Field(max_length=200)]
    warnings: Annotated[list[Annotated[str, Field(max_length=2000)]], Field(max_length=1000)]


def calibration_page(path: Path) -> html.Page:
    """Return the page of a `NAME_fit.json`, with the preset and the figure in its folder."""
    values = read_json(path, 16 * MEBIBYTE)
    try:
        fit = validated(FitFile, values)
    except ValueError as error:
        raise InputError(f"{path} is not the report of a calibration: {error}") from error
    origin = stated_origin(values)
    stem = path.name.removesuffix(FIT_END)
    preset = path.with_name(f"{stem}.yaml")
    (picture,) = html.of_file(path.with_name(f"{stem}_fit.png"), lambda of: [html.figure(of, _CAPTION)])
    steps, (errors, *tensions) = _next_steps(fit, preset, origin), _errors(fit)
    shown = (html.side_by_side(picture, steps),) if len(fit.logs) < WIDE else (picture, steps)
    page = html.Page(
        "EndoTwin calibration: a twin of a measured endoscope", stem, intro=(_answer(fit), *shown, errors)
    )
    if tensions:
        page.add("Tension of the wires", *tensions)
    page.add("Parameters", *_parameters(fit))
    groups: dict[str, html.Facts] = {"Search": (("optimizer", fit.optimizer), ("seed", f"{fit.seed}"))}
    if preset.is_file():
        title = f"Preset {preset.name}, in SI units"
        try:
            groups[title] = html.flat_facts(read_yaml(preset, MEBIBYTE))
        except ValueError as error:
            groups[title] = (("cannot be shown", cut(error, 200)),)
    repeat = (*html.origin_command(origin, str(preset)), f"endotwin report {preset}")
    page.add_origin(repeat, {**groups, **html.origin_facts(origin)})
    return page


def _errors_over(fit: FitFile, index: str) -> dict[str, float]:
    """Return the RMSE over all logs that have one [deg]: of the twin (""), and of models without physics."""
    found = {}
    for name in ("", *RIVALS):
        known = [of.get(f"{name}_{index}" if name else index) for of in fit.logs if of.get(index) is not None]
        if errors := [float(of) for of in known if of is not None]:
            found[name] = math.sqrt(sum(error**2 for error in errors) / len(errors))
    return found


def _answer(fit: FitFile) -> Markup:
    fitted, predicted = (_errors_over(fit, of) for of in ("rmse_deg", "held_out_rmse_deg"))
    parts = [f"follows the logs within {fitted.pop(''):.2f} deg"] if fitted else []
    parts += [f"predicts what was not fitted within {predicted['']:.2f} deg"] if predicted else []
    best = min(fitted, key=fitted.__getitem__, default="")
    more = f"; the best model without physics, {_title(best)}, has {fitted[best]:.2f}" if best else ""
    line = (
        f"The twin {' and '.join(parts)} (RMSE){more}." if parts else "The twin follows no log: it diverges."
    )
    return html.text(line, "headline")


def _title(rival: str) -> str:
    return rival.title().replace("_", "-")


def _next_steps(fit: FitFile, preset: Path, origin: Origin | None) -> Markup:
    steps, errors = [], _errors_over(fit, "rmse_deg")
    if errors and errors[""] > min(errors.values()):
        steps.append(_NEARER)
    if fit.warnings:
        steps.append(_OPEN)
    if not _errors_over(fit, "held_out_rmse_deg"):
        steps.append(_UNPROVEN)
    steps.append(Markup("Train on twins of this preset; the gate then judges the result on your logs:"))
    logs = shlex.join(of.path for of in origin.data) if origin and origin.data else "data/measured"
    given = shlex.quote(str(preset))
    train = f"endotwin train --agent ram --protocol twins --preset {given} --seed 1 --out runs/device"
    gate = f"endotwin gate runs/device/policy.onnx {logs} --preset {given} --out gate.html"
    title = html.text(Markup("<strong>What to do next</strong>"))
    return title + html.bullets(steps) + html.commands((train, gate))


def _errors(fit: FitFile) -> Sequence[Markup]:
    rivals = [rival for rival in RIVALS if any(f"{rival}_rmse_deg" in log for log in fit.logs)]
    rows: list[Sequence[str | html.Cell]] = []
    for log in fit.logs:
        bend = log.get("sheath_bend_deg")
        for index, what in (("rmse_deg", "fitted"), ("held_out_rmse_deg", "predicted")):
            errors = [log.get(f"{name}{index}") for name in ("", *(f"{rival}_" for rival in rivals))]
            known = [float(error) for error in errors if error is not None]
            if known:
                cells = [
                    html.Cell("-")
                    if of is None
                    else html.Cell(f"{of:.2f}", (), "best" if of == min(known) else "")
                    for of in errors
                ]
                rows.append((str(log.get("name")), "-" if bend is None else f"{bend:g}", what, *cells))
    head = (
        "log",
        "sheath bent by [deg]",
        "it was",
        "twin",
        *map(_title, rivals),
    )
    note = (
        "RMSE in degrees, the least of a row in bold; the offset of a fitted log is removed. One twin is for "
        "all logs; a model without physics is fitted to each bend of the sheath separately."
    )
    parts = [html.table(head, rows, note=note, cards=True)]
    wires = [f"tension_{wire}_rmse_percent_of_range" for wire in "ab"]
    tension = [
        (str(log.get("name")), *("-" if log.get(wire) is None else f"{log[wire]:.1f} %" for wire in wires))
        for log in fit.logs
        if log.get(wires[0]) is not None
    ]
    if tension:
        note = "RMSE in percent of the range of the measured tension."
        parts.append(html.table(("log", "wire a", "wire b"), tension, note=note))
    return parts


def _parameters(fit: FitFile) -> Sequence[Markup]:
    rows = []
    for name, known in fit.parameters.items():
        deviation = known.standard_deviation
        found = "not determined" if deviation is None else f"{deviation:.2g}"
        rows.append((name, f"{known.value:.4g}", found))
    note = "In SI units, as in the preset's file; docs/physics.md describes each."
    parts = [html.table(("parameter", "value", "standard deviation"), rows, note=note)]
    return (
        [*parts, html.text("Warnings of the calibration:"), html.bullets(fit.warnings)]
        if fit.warnings
        else parts
    )
