"""Files of a comparison of controllers: `control.json`, a table, and recordings for the figures."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.control.conditions import ControlCondition, ControlSettings
from twin.control.controller import UNCOMPENSATED, is_oracle
from twin.control.trial import ControlTrial
from twin.evaluation.metrics import confidence_interval
from twin.evaluation.protocol import ALL_CONDITIONS
from twin.files.atomic import MADE_BY, write_whole
from twin.gate.trial import reduction_interval
from twin.simulation import simulate

Array = NDArray[np.float64]
MEASURES = (
    "rmse_deg",
    "worst_deg",
    "late_rmse_deg",
    "late_worst_deg",
    "travel_mm",
    "estimate_rmse_deg",
    "fallback_share",
    "holding_reversals_per_s",
)


@dataclasses.dataclass(frozen=True)
class ControlResult:
    """Measures of all trials of one controller under one condition."""

    controller: str
    condition: ControlCondition
    strokes_mm: tuple[tuple[float, float], ...]  # in the order of the first axis of measures
    measures: dict[str, Array]  # by the names of `MEASURES`, each (strokes, twins, signals)
    settings: dict[str, float]  # what was tuned for it

    @property
    def squares(self) -> Array:
        """Mean square errors, (twins, strokes and signals) [deg^2]."""
        error = self.measures["rmse_deg"]
        return np.moveaxis(error, 1, 0).reshape(error.shape[1], -1) ** 2

    @property
    def by_twin_deg(self) -> Array:
        """Root mean square error of each twin, (twins,) [deg]."""
        error: Array = np.sqrt(self.squares.mean(axis=1))
        return error

    @property
    def rmse_deg(self) -> float:
        """Root mean square error of all trials [deg]."""
        return float(np.sqrt(self.squares.mean()))

    def total(self) -> dict[str, Any]:
        """Return the measures of all trials together; late values are of the last 20 s."""
        measures = self.measures
        return {
            "controller": self.controller,
            "oracle": is_oracle(self.controller),
            "condition": self.condition.name,
            "rmse_deg": self.rmse_deg,
            "worst_twin_rmse_deg": float(self.by_twin_deg.max()),
            "late_rmse_deg": float(np.sqrt(np.mean(measures["late_rmse_deg"] ** 2))),
            "late_worst_deg": float(measures["late_worst_deg"].max()),
            "travel_mm": float(measures["travel_mm"].mean()),
            "fallback_share": float(measures["fallback_share"].mean()),
            "holding_reversals_per_s": _mean(measures["holding_reversals_per_s"]),
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each signal and stroke."""
        condition, rows = self.condition, []
        for s, stroke in enumerate(self.strokes_mm):
            for k, signal in enumerate(condition.signals):
                mine = {name: values[s, :, k] for name, values in self.measures.items()}
                mean = {name: float(values.mean()) for name, values in mine.items()}
                rows.append(
                    {
                        "controller": self.controller,
                        "condition": condition.name,
                        "noise": condition.noise,
                        "level": condition.level,
                        "sample_time_s": condition.sample_time,
                        "signal": signal,
                        "stroke_mm": list(stroke),
                        "twins": len(mine["rmse_deg"]),
                        "rmse_deg": mean["rmse_deg"],
                        "rmse_ci95_deg": list(confidence_interval(mine["rmse_deg"])),
                        "worst_twin_rmse_deg": float(mine["rmse_deg"].max()),
                        "worst_deg": float(mine["worst_deg"].max()),
                        "late_rmse_deg": mean["late_rmse_deg"],
                        "late_worst_deg": float(mine["late_worst_deg"].max()),
                        "travel_mm": mean["travel_mm"],
                        "estimate_rmse_deg": _mean(mine["estimate_rmse_deg"]),
                        "fallback_share": mean["fallback_share"],
                        "holding_reversals_per_s": _mean(mine["holding_reversals_per_s"]),
                    }
                )
        return rows


@dataclasses.dataclass(frozen=True)
class Comparison:
    """All results, and the trials that figures show."""

    results: list[ControlResult]
    shown: dict[str, ControlTrial]  # by controller, of the first twin, stroke, condition and signal
    tuned: list[dict[str, Any]]  # by sensor and controller: settings, and their error in the tuning


def measures_of(trial: ControlTrial) -> tuple[float, ...]:
    """Return the measures of a trial, in the order of `MEASURES`; -1 where there is none."""
    off = (trial.estimate_deg - trial.truth_deg)[trial.scored]
    measures = (
        trial.rmse_deg,
        float(np.abs(trial.error_deg).max()),
        float(np.sqrt(np.mean(trial.late_error_deg**2))),
        float(np.abs(trial.late_error_deg).max()),
        trial.travel_mm,
        float(np.sqrt(np.mean(off**2))),
        float(trial.fell_back[trial.scored].mean()),
        trial.holding_reversals_per_s,
    )
    return tuple(np.nan_to_num(measures, nan=-1.0).tolist())


def _mean(values: Array) -> float | None:
    """Return the mean of the values that there are, if any."""
    known = values[values >= 0]
    return float(known.mean()) if known.size else None


def comparisons(results: Sequence[ControlResult], ours: str) -> list[dict[str, Any]]:
    """Return how much less error ours has than each other controller, under each condition; oracles are none.

    The 95 % interval is paired: both saw the same twins, references and noise.
    """
    found = []
    for result in [of for of in results if of.controller == ours]:
        rivals = [of for of in results if of.controller != ours and not is_oracle(of.controller)]
        for other in [of for of in rivals if of.condition == result.condition]:
            interval = reduction_interval(result.squares, other.squares)
            found.append(
                {
                    "condition": result.condition.name,
                    "controller": ours,
                    "rival": other.controller,
                    "rmse_deg": result.rmse_deg,
                    "rival_rmse_deg": other.rmse_deg,
                    "reduction": 1 - result.rmse_deg / max(other.rmse_deg, 1e-9),
                    "reduction_ci95": list(interval),
                }
            )
    return found


def with_percentages(lines: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rows or totals with their errors as a percentage of the uncompensated one, None without it."""

    def place(of: Mapping[str, Any]) -> tuple[Any, ...]:
        return of["condition"], of.get("signal"), *of.get("stroke_mm", ())

    most = {place(of): max(of["rmse_deg"], 1e-9) for of in lines if of["controller"] == UNCOMPENSATED}
    found = []
    for of in lines:
        percent = 100 * (of["rmse_deg"] / most[place(of)]) if place(of) in most else None
        found.append(of | {"percent_of_uncompensated": percent})
    return found


RESULTS = "control.json"
RECORDS = "records"
RECORD_SIGN = "tracking_rmse_deg"  # metadata that no other recording has


def pooled(results: Sequence[ControlResult]) -> list[ControlResult]:
    """Return a result for each controller: the endoscopes of all conditions together."""
    found = []
    for name in dict.fromkeys(of.controller for of in results):
        mine = [of for of in results if of.controller == name]
        measures = {of: np.concatenate([each.measures[of] for each in mine], axis=1) for of in MEASURES}
        found.append(ControlResult(name, ControlCondition(ALL_CONDITIONS), mine[0].strokes_mm, measures, {}))
    return found


def control_values(
    comparison: Comparison,
    settings: ControlSettings,
    ours: str | None,
    origin: Mapping[str, Any],
    test_set: str = "",
) -> dict[str, Any]:
    """Return what `control.json` holds; a sealed test set has a name, and totals of all conditions."""
    results = comparison.results
    together = [*pooled(results), *results] if test_set else results
    limits = [dataclasses.asdict(settings.limits(stroke)) for stroke in settings.strokes_mm]
    stated = settings.to_dict()
    protocol = {
        "version": __version__,
        "policy_sha256": stated["policy"],
        "tracking_policy_sha256": stated["tracking_policy"],
        "preset": settings.preset.name,
        "limits": limits,
        "sensor_latency_s": settings.latency_s,
        "test_set": test_set or None,
    }
    kept = ("physics", "twins", "seconds", "preview_s", "candidates", "tuning_seconds", "seed")
    protocol |= {name: stated[name] for name in kept}
    return {
        "control": protocol,
        "totals": with_percentages([result.total() for result in together]),
        "rows": with_percentages([row for result in results for row in result.rows()]),
        "comparisons": comparisons(together, ours) if ours else [],
        "tuned": comparison.tuned,
        "origin": dict(origin),
    }


def write_values(folder: Path, values: dict[str, Any]) -> Path:
    """Write `control.json`; returns its path."""
    path = folder / RESULTS
    write_whole(path, json.dumps(values, indent=1) + "\n")
    return path


def write_record(
    folder: Path, trial: ControlTrial, settings: ControlSettings, condition: ControlCondition, controller: str
) -> Path:
    """Write a trial on the first twin of a condition as MCAP, simulated again along its commands.

    It holds command, truth, measurement, `/reference` and the controller's estimate.
    """
    from twin.recording.messages import REFERENCE_TOPIC, estimate_message, estimate_topic, to_nanoseconds
    from twin.recording.writer import EpisodeWriter

    preset, samples = settings.held_out(0, condition), len(trial.pull_mm)
    sheath_bend, forces = condition.sheath_bend(preset, samples), iter(condition.tip_forces(samples)[1:])

    def push(endoscope: Any) -> None:
        endoscope.push_tip(next(forces, 0.0))

    episode = simulate(
        preset,
        trial.pull_mm * 1e-3,
        trial.sample_time,
        physics=settings.physics,
        sheath_bend=sheath_bend if len(sheath_bend) else None,
        on_sample=push if condition.tip_force else None,
    )
    facts = {**episode.metadata, "controller": controller, RECORD_SIGN: trial.rmse_deg}
    episode = dataclasses.replace(episode, measured_bend=np.radians(trial.measured_deg), metadata=facts)
    path = folder / RECORDS / f"{controller}.mcap"
    path.parent.mkdir(exist_ok=True)
    with EpisodeWriter(path) as writer:
        writer.write(episode)
        for k, time in enumerate(to_nanoseconds(episode.time)):
            writer.add_message(REFERENCE_TOPIC, estimate_message(float(trial.reference_deg[k])), int(time))
            if np.isfinite(trial.estimate_deg[k]):
                message = estimate_message(float(trial.estimate_deg[k]))
                writer.add_message(estimate_topic(controller), message, int(time))
    return path


TABLE = "control.md"  # file of all tables

MORE = {
    "RMSE as a percentage of the uncompensated one": "percent_of_uncompensated",
    "Reversals of the command per second while the reference is held": "holding_reversals_per_s",
}
"""Captions of tables of measures that a comparison may lack, and the measures."""
CAPTION = "RMSE of tracking [deg] of all trials, in brackets that of the worst twin."

Values = Mapping[str, Any]
Cells = dict[str, dict[str, str]]
_ERROR = "{rmse_deg:.2f} ({worst_twin_rmse_deg:.2f})"
_LATE = "{late_rmse_deg:.2f} ({late_worst_deg:.1f})"
_REFERENCE = "{condition}: {signal}, [{stroke_mm[0]:g}, {stroke_mm[1]:g}] mm"
_LESS = "{percent[0]:.0f} % ({percent[1]:.0f} to {percent[2]:.0f})"


def control_table(totals: Sequence[Values], fmt: str = "markdown") -> str:
    """Return the table of errors: one row a condition, one column a controller [deg]."""
    cells = _cells(totals, _ERROR)
    first = next(iter(cells))
    travels = {of["controller"]: of["travel_mm"] for of in totals if of["condition"] == first}
    cells[f"travel of the command, {first} [mm]"] = {
        name: f"{travel:.1f}" for name, travel in travels.items()
    }
    return _table("condition", cells, fmt)


def write_tables(folder: Path, values: Values) -> None:
    """Write all tables as Markdown."""
    totals, against = values["totals"], values["comparisons"]
    parts = [
        CAPTION,
        control_table(totals),
        "The last 20 s: RMSE [deg], in brackets the largest error.",
        _table("condition", _cells(totals, _LATE)),
        "Travel of the command, mean of a trial [mm].",
        _table("condition", _cells(totals, "{travel_mm:.1f}")),
    ]
    for caption, name in MORE.items():
        if known := [of for of in totals if of[name] is not None]:
            parts += [f"{caption}.", _table("condition", _cells(known, f"{{{name}:.1f}}"))]
    if against:
        less = [of | {"percent": 100 * np.array([of["reduction"], *of["reduction_ci95"]])} for of in against]
        parts += [
            f"How much less error {against[0]['controller']} has (95 % interval, paired).",
            _table("condition", _cells(less, _LESS, column="rival")),
        ]
    parts += [
        "Each reference: mean RMSE of the twins [deg], in brackets the worst.",
        _table("reference", _cells(values["rows"], _ERROR, _REFERENCE)),
        f"<!-- {MADE_BY} -->",
    ]
    write_whole(folder / TABLE, "\n\n".join(parts) + "\n")


def _cells(
    values: Sequence[Values], cell: str, row: str = "{condition}", column: str = "controller"
) -> Cells:
    """Return texts by row and column, in the order in which both come."""
    cells: Cells = {}
    for of in values:
        cells.setdefault(row.format_map(of), {})[of[column]] = cell.format_map(of)
    return cells


def _table(first: str, cells: Cells, fmt: str = "markdown") -> str:
    from tabulate import tabulate

    names = list(dict.fromkeys(name for row in cells.values() for name in row))
    rows = [[place, *(row.get(name, "") for name in names)] for place, row in cells.items()]
    kind = "pipe" if fmt == "markdown" else fmt
    return str(tabulate(rows, [first, *names], tablefmt=kind, disable_numparse=True))
