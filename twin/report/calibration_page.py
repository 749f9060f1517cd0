"""The page of a calibration: how near the twin comes to each log, beside models without physics."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json, validated
from twin.files.origin import stated_origin
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml
from twin.report.facts import flat_facts, origin_command, origin_groups
from twin.report.parts import (
    Cell,
    Facts,
    Gap,
    Lines,
    Page,
    Part,
    Section,
    Table,
    Text,
    png_picture,
    repeat_section,
)

FIT_END = "_fit.json"
"""End of the name of the report that stands beside a calibrated preset."""
RIVALS = ("coleman_hodgdon", "prandtl_ishlinskii", "bouc_wen")
"""Models without physics that a calibration may be compared with, as its report names them."""

Name = Annotated[str, Field(max_length=200)]
Number = Annotated[float, Field(allow_inf_nan=False)]


class FittedParameter(BaseModel):
    """A parameter of a calibrated preset.

    Attributes:
        value: as fitted, in its SI unit.
        standard_deviation: of the fit; None where the logs do not tell it.
    """

    model_config = ConfigDict(frozen=True)

    value: Number
    standard_deviation: Number | None


class FitFile(BaseModel):
    """Contents of `NAME_fit.json`, as far as the page needs them; other versions may add some.

    Attributes:
        optimizer: how it was searched.
        seed: of the search.
        logs: errors on each log, by name of the figure; None where there is nothing to compare.
        parameters: that were fitted, by name.
        warnings: of the calibration.
    """

    model_config = ConfigDict(frozen=True)

    optimizer: Name
    seed: int
    logs: Annotated[list[dict[Name, str | Number | None]], Field(min_length=1, max_length=10_000)]
    parameters: Annotated[dict[Name, FittedParameter], Field(max_length=200)]
    warnings: Annotated[list[Annotated[str, Field(max_length=2000)]], Field(max_length=1000)]


def calibration_page(path: Path) -> Page:
    """Return the page of a `NAME_fit.json`, and of the preset and the figure beside it.

    Raises:
        ValueError: it is no such file.
    """
    values = read_json(path, 16 * MEBIBYTE)
    try:
        fit = validated(FitFile, values)
    except ValueError as error:
        raise InputError(f"{path} is not the report of a calibration: {error}") from error
    origin = stated_origin(values)
    stem = path.name.removesuffix(FIT_END)
    preset = path.with_name(f"{stem}.yaml")
    sections = [
        Section("The logs and the twin", (_picture(path.with_name(f"{stem}_fit.png")),)),
        Section("Errors on every log", _errors(fit)),
        Section("Parameters", _parameters(fit)),
        Section("What was run", (Facts((*_groups(fit, preset), *origin_groups(origin))),)),
        repeat_section((*origin_command(origin, str(preset)), f"endotwin report {preset}")),
    ]
    return Page(
        verb="report",
        kicker="EndoTwin calibration: a twin of a measured endoscope",
        title=stem,
        headline=calibration_headline(fit),
        sections=tuple(sections),
    )


def calibration_headline(fit: FitFile) -> str:
    """Return what a reader should take away, in one sentence."""
    fitted = [log for log in fit.logs if log.get("rmse_deg") is not None]
    unseen = [log for log in fit.logs if log.get("rmse_deg") is None and _held(log, "") is not None]
    parts = []
    if fitted:
        worst = max(_number(log["rmse_deg"]) for log in fitted)
        logs = (
            f"{len(fitted)} logs that it was fitted to"
            if len(fitted) > 1
            else "the log that it was fitted to"
        )
        parts.append(f"follows {logs} to {worst:.2f} deg (RMSE)")
        beside = _best_rival(fitted, "rmse_deg")
        if beside:
            parts[-1] += f", where the best model without physics has {beside}"
    if unseen:
        worst = max(_number(_held(log, "")) for log in unseen)
        logs = f"{len(unseen)} others" if len(unseen) > 1 else "one other"
        parts.append(f"predicts {logs} within {worst:.2f} deg")
        beside = _best_rival(unseen, "held_out_rmse_deg")
        if beside:
            parts[-1] += f", against {beside}"
    if not parts:
        return "The calibrated twin diverges along every log."
    return f"One twin {', and '.join(parts)}."


def _best_rival(logs: list[dict[str, Any]], figure: str) -> str:
    """Return the smallest of the rivals' worst errors, in words."""
    worst = {}
    for rival in RIVALS:
        values = [log.get(f"{rival}_{figure}") for log in logs]
        known = [_number(value) for value in values if value is not None]
        if len(known) == len(values):
            worst[rival] = max(known)
    if not worst:
        return ""
    best = min(worst, key=lambda rival: worst[rival])
    return f"{worst[best]:.2f} ({_in_words(best)})"


def _held(log: dict[str, Any], prefix: str) -> Any:
    return log.get(f"{prefix}held_out_rmse_deg")


def _number(value: Any) -> float:
    return float(value)


def _picture(path: Path) -> Part:
    if not path.is_file():
        return Gap(f"There is no {path.name} beside this report.")
    caption = (
        "Each log, and the twin driven by its command alone: it sees no measurement. "
        "Errors are below, beside those of models without physics."
    )
    try:
        return png_picture(path, caption)
    except InputError as error:
        return Gap(f"{path.name} cannot be shown: {cut(error, 200)}.")


def _in_words(rival: str) -> str:
    """Return the name of a model, which is that of its authors."""
    return rival.title().replace("_", "-")


def _errors(fit: FitFile) -> tuple[Part, ...]:
    rivals = [rival for rival in RIVALS if any(f"{rival}_rmse_deg" in log for log in fit.logs)]
    rows = []
    for log in fit.logs:
        for figure, what in (("rmse_deg", "fitted"), ("held_out_rmse_deg", "predicted")):
            figures = [log.get(f"{name}_{figure}" if name else figure) for name in ("", *rivals)]
            if all(value is None for value in figures):
                continue
            known = [_number(value) for value in figures if value is not None]
            cells = tuple(_cell(value, known) for value in figures)
            bend = log.get("sheath_bend_deg")
            rows.append((str(log.get("name")), "-" if bend is None else f"{bend:g}", what, *cells))
    head = ("log", "sheath bent by [deg]", "it was", "twin", *map(_in_words, rivals))
    note = (
        "RMSE in degrees; the offset of a fitted log is taken off. The twin is one for all logs; a model "
        "without physics is fitted anew to each bend of the sheath."
    )
    tension = [
        (str(log.get("name")), *(_percent(log.get(f"tension_{wire}_rmse_percent_of_range")) for wire in "ab"))
        for log in fit.logs
        if log.get("tension_a_rmse_percent_of_range") is not None
    ]
    parts: list[Part] = [Table(head, tuple(rows), note=note, cards=True)]
    if tension:
        note = "RMSE in percent of the range of the measured tension."
        parts.append(Table(("log", "wire a", "wire b"), tuple(tension), "Tension of the wires", note))
    return tuple(parts)


def _cell(value: Any, known: list[float]) -> Cell | str:
    if value is None:
        return "-"
    return Cell(f"{value:.2f}", (), "best" if value == min(known) else "")


def _percent(value: Any) -> str:
    return "-" if value is None else f"{value:.1f} %"


def _parameters(fit: FitFile) -> tuple[Part, ...]:
    rows = tuple(
        (
            name,
            f"{known.value:.4g}",
            "not told" if known.standard_deviation is None else f"{known.standard_deviation:.2g}",
        )
        for name, known in fit.parameters.items()
    )
    note = "In SI units, as in the preset's file; docs/physics.md and the preset's module say what each is."
    table = Table(("parameter", "value", "standard deviation"), rows, note=note)
    if not fit.warnings:
        return (table,)
    return (table, Text("The calibration warns:"), Lines(tuple(fit.warnings)))


def _groups(fit: FitFile, preset: Path) -> tuple[tuple[str, tuple[tuple[str, str], ...]], ...]:
    search = ("Search", (("optimizer", fit.optimizer), ("seed", f"{fit.seed}")))
    try:
        values = tuple(flat_facts(read_yaml(preset, MEBIBYTE)))
    except (OSError, ValueError):
        return (search,)
    return (search, (f"Preset {preset.name}, in SI units", values))
