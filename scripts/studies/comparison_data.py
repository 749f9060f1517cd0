"""Files of docs/data from a folder of `evaluate --suite full` or `sealed`, or of `control`."""

import csv
import datetime
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.control.results import RESULTS as CONTROL
from twin.errors import InputError
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import ALL_CONDITIONS
from twin.evaluation.ranking import competes
from twin.files.atomic import write_whole
from twin.files.origin import stated_origin
from twin.report.tables import csv_text

LIMIT, REFERENCE = "Ensemble (limit)", "RAM (twins)"
_ITS_PARTS = "RAM (twins), "  # how the names of rows without a part of it begin
SAMPLE_TIME = 0.1  # of the published tables [s]
_LESS = ("less error by members-inverse [%]", "low", "high")
_SHORT = {"nominal": "the preset"}

Score = Mapping[str, str]


def write_comparison(results: Path, data: Path, commit: str) -> None:
    """Write scores.csv, costs.csv and the tables of the comparison into `data`; `commit` made the run.

    Of the sealed suite, write sealed.csv, with the test set and how many were tried. Of a comparison of
    controllers, write the totals of the first condition or, if sealed, of all, and each one's errors.
    """
    control = results / CONTROL
    path = control if control.is_file() else results / "evaluation.json"
    evaluation = json.loads(path.read_text())
    origin = stated_origin(evaluation)
    if origin is None:
        raise InputError(f"{path} states no origin")
    date = datetime.date.fromtimestamp(path.stat().st_mtime)
    head = file_head(commit, origin.command, date, origin.versions)
    if "control" in evaluation:
        name = "control_sealed" if evaluation["control"].get("test_set") else "control"
        write_whole(data / f"{name}_totals.csv", head + controllers(evaluation))
        if len({of["condition"] for of in evaluation["totals"]}) > 1:
            write_whole(data / f"{name}.csv", head + conditions(evaluation["totals"]))
        return
    sealed = results / "sealed.csv"
    if sealed.is_file():
        of = evaluation["protocol"]
        command = f"{origin.command}  (test set {of['test_set']}; {of['test_sets_in_this_folder']} tried)"
        head = file_head(commit, command, date, origin.versions)
        write_whole(data / "sealed.csv", head + sealed.read_text())
        return
    given = {row["method"]: ", ".join(row["given"]) for row in evaluation["rows"]}
    for name in ("scores", "costs"):
        write_whole(data / f"{name}.csv", head + (results / f"{name}.csv").read_text())
    table = (results / "scores.csv").read_text()
    scores = [row for row in csv.DictReader(table.splitlines()) if float(row["sample_time_s"]) == SAMPLE_TIME]
    write_whole(data / "rivals.csv", head + rivals(scores, given))
    write_whole(data / "rmse_groups.csv", head + groups(scores))
    write_whole(data / "better_cells.csv", head + better_cells(scores))


def file_head(commit: str, command: str, date: datetime.date, versions: Mapping[str, str]) -> str:
    """Return the first lines of a file of docs/data."""
    packages = " ".join(f"{name} {version}" for name, version in versions.items())
    return f"# commit: {commit}\n# command: {command}\n# date: {date.isoformat()}\n# versions: {packages}\n"


def rivals(scores: Sequence[Score], given: Mapping[str, str]) -> str:
    """Return geometric means of the RMSE by kind of twin, what each method knows, and its coverage."""
    kinds = list(dict.fromkeys(score["twin"] for score in scores))
    of = _by_method(scores)
    if LIMIT not in of or REFERENCE not in of:
        raise InputError(f"scores.csv must have the methods {LIMIT} and {REFERENCE} at T = {SAMPLE_TIME} s")
    limit = _mean(of[LIMIT])
    lines = []
    for method in _ranked(of):
        mine = of[method]
        covered = [float(score["coverage95"]) for score in mine if score["coverage95"]]
        lines.append(
            {"method": method, "knows": given.get(method, "")}
            | {_SHORT.get(kind, kind): _text(_mean([s for s in mine if s["twin"] == kind])) for kind in kinds}
            | {"all": _text(_mean(mine)), "times the limit": _text(_mean(mine) / limit)}
            | {"coverage [%]": _text(100 * float(np.mean(covered))) if covered else ""}
            | {"draws": mine[0]["seeds"], "trainings": mine[0]["trainings"]}
        )
    return csv_text(lines)


def groups(scores: Sequence[Score]) -> str:
    """Return geometric means of the RMSE over the noises, by group of records."""
    of = _by_method(scores)
    names = list(dict.fromkeys(map(_group, scores)))
    return csv_text(
        [
            {"method": method}
            | {name: _text(_mean([score for score in of[method] if _group(score) == name])) for name in names}
            for method in _ranked(of)
        ]
    )


def better_cells(scores: Sequence[Score]) -> str:
    """Return every noise and group in which another deployable method has less error than RAM (twins)."""
    cells: dict[str, list[Score]] = {}
    for score in scores:
        method = score["method"]
        if competes(method, score["oracle"] == "true") and not method.startswith(_ITS_PARTS):
            cells.setdefault(f"{_noise(score)}, {_group(score)}", []).append(score)
    lines = []
    for name, of in cells.items():
        best = min(of, key=lambda score: float(score["rmse_deg"]))
        ours = next(score for score in of if score["method"] == REFERENCE)
        if float(best["rmse_deg"]) < float(ours["rmse_deg"]):
            lines.append(
                {"noise and group": name, "best method": best["method"], "its RMSE": best["rmse_deg"]}
                | {REFERENCE: ours["rmse_deg"]}
            )
    return csv_text(lines)


def controllers(values: Mapping[str, Any]) -> str:
    """Return the totals of each controller: of all sealed conditions, or of the first one."""
    totals = values["totals"]
    first = totals[0]["condition"]
    best: dict[str, tuple[float, str]] = {}  # by condition
    for of in totals:
        if not of["oracle"] and of["condition"] != ALL_CONDITIONS:
            mine = (of["rmse_deg"], of["controller"])
            best[of["condition"]] = min(mine, best.get(of["condition"], mine))
    winners = [name for _, name in best.values()]
    less = {of["rival"]: of for of in values["comparisons"] if of["condition"] == first}
    leads: dict[str, float] = {}
    for of in values["tuned"]:
        lead = of["settings"].get("lead_s", 0.0)
        leads[of["controller"]] = max(lead, leads.get(of["controller"], 0.0))
    lines = []
    for of in [of for of in totals if of["condition"] == first]:
        name = of["controller"]
        against = less.get(name)
        percent = (against["reduction"], *against["reduction_ci95"]) if against else ()
        lines.append(
            {
                "controller": name,
                "RMSE [deg]": f"{of['rmse_deg']:.2f}",
                "worst endoscope": f"{of['worst_twin_rmse_deg']:.2f}",
                "percent of uncompensated": f"{of['percent_of_uncompensated']:.1f}",
                "best in": str(winners.count(name)),
                "travel [mm]": f"{of['travel_mm']:.1f}",
                "reversals per second while held": f"{of['holding_reversals_per_s']:.2f}",
            }
            | dict(zip(_LESS, [f"{100 * end:.0f}" for end in percent] or [""] * 3, strict=True))
            | {"largest lead [s]": f"{leads[name]:.2f}" if leads.get(name) else ""}
        )
    return csv_text(lines)


def conditions(totals: Sequence[Mapping[str, Any]]) -> str:
    """Return the error of each controller under each condition, and that of the worst endoscope."""
    names = dict.fromkeys(of["controller"] for of in totals)
    none = {column: "" for name in names for column in (name, f"{name}, worst")}
    lines: dict[str, dict[str, str]] = {}
    for of in totals:
        name, condition = of["controller"], of["condition"]
        line = lines.setdefault(condition, {"condition": condition} | none)
        line[name] = f"{of['rmse_deg']:.2f}"
        line[f"{name}, worst"] = f"{of['worst_twin_rmse_deg']:.2f}"
    return csv_text(list(lines.values()))


def _by_method(scores: Sequence[Score]) -> dict[str, list[Score]]:
    found: dict[str, list[Score]] = {}
    for score in scores:
        found.setdefault(score["method"], []).append(score)
    return found


def _ranked(of: Mapping[str, Sequence[Score]]) -> list[str]:
    return sorted(of, key=lambda method: _mean(of[method]))


def _group(score: Score) -> str:
    kind = _SHORT.get(score["twin"], score["twin"])
    return f"{kind} [{score['stroke_low_mm']}; {score['stroke_high_mm']}] mm"


def _noise(score: Score) -> str:
    return noise_label(score["noise"], float(score["level"]))


def _mean(scores: Sequence[Score]) -> float:
    return float(np.exp(np.mean([np.log(float(score["rmse_deg"])) for score in scores])))


def _text(value: float) -> str:
    return f"{value:.4g}"
