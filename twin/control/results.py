"""Files of a comparison of controllers: `control.json`, a table, and recordings of what figures show."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin import __version__
from twin.control.comparison import Comparison
from twin.control.score import comparisons
from twin.control.settings import ControlSettings
from twin.control.trial import ControlTrial
from twin.episode import Episode
from twin.files.atomic import write_whole
from twin.files.ours import MADE_BY
from twin.simulation import simulate

RESULTS = "control.json"
TABLE = "control.md"
RECORDS = "records"
RECORD_SIGN = "tracking_rmse_deg"
"""Metadata that no other recording has."""


def control_values(comparison: Comparison, settings: ControlSettings, ours: str | None) -> dict[str, Any]:
    """Return what `control.json` holds."""
    results = comparison.results
    limits = [dataclasses.asdict(settings.limits(stroke)) for stroke in settings.strokes_mm]
    protocol = {
        "version": __version__,
        "policy_sha256": settings.to_dict()["policy"],
        "tracking_policy_sha256": settings.to_dict().get("tracking_policy"),
        "preset": settings.preset.name,
        "physics": settings.physics,
        "twins": settings.twins,
        "seconds": settings.seconds,
        "limits": limits,
        "sensor_latency_s": settings.latency_s,
        "candidates": settings.candidates,
        "tuning_seconds": settings.tuning_seconds,
        "seed": settings.seed,
    }
    return {
        "control": protocol,
        "totals": [result.total() for result in results],
        "rows": [row for result in results for row in result.rows()],
        "comparisons": comparisons(results, ours, settings.seed) if ours else [],
        "tuned": comparison.tuned,
    }


def write_values(folder: Path, values: dict[str, Any]) -> Path:
    """Write `control.json`; returns its path."""
    path = folder / RESULTS
    write_whole(path, json.dumps(values, indent=1) + "\n")
    return path


def control_table(totals: Sequence[dict[str, Any]], fmt: str = "markdown") -> str:
    """Return the table of errors: one row a condition, one column a controller [deg].

    Args:
        totals: of each controller under each condition, as `control.json` has them.
        fmt: of the table, as `tabulate` names it: `markdown` or `plain`.
    """
    from tabulate import tabulate

    names = list(dict.fromkeys(total["controller"] for total in totals))
    cells: dict[str, dict[str, str]] = {}
    for total in totals:
        said = f"{total['rmse_deg']:.2f} ({total['worst_twin_rmse_deg']:.2f})"
        cells.setdefault(total["condition"], {})[total["controller"]] = said
    rows = [[condition, *(of.get(name, "") for name in names)] for condition, of in cells.items()]
    first = next(iter(cells))
    ways = {of["controller"]: of["travel_mm"] for of in totals if of["condition"] == first}
    rows.append([f"way of the command, {first} [mm]", *(f"{ways[name]:.1f}" for name in names)])
    kind = "pipe" if fmt == "markdown" else fmt
    return str(tabulate(rows, ["condition", *names], tablefmt=kind, disable_numparse=True))


def write_table(folder: Path, totals: Sequence[dict[str, Any]]) -> None:
    """Write the table as Markdown."""
    said = "RMSE of tracking [deg], in brackets that of the worst twin."
    write_whole(folder / TABLE, f"{said}\n\n{control_table(totals)}\n\n<!-- {MADE_BY} -->\n")


def record_of(trial: ControlTrial, settings: ControlSettings, controller: str) -> Episode:
    """Return the episode of a trial on the first twin, simulated anew along its commands."""
    preset = settings.held_out(0)
    episode = simulate(preset, trial.pull_mm * 1e-3, trial.sample_time, physics=settings.physics)
    facts = {"controller": controller, RECORD_SIGN: trial.rmse_deg}
    return dataclasses.replace(
        episode, measured_bend=np.radians(trial.measured_deg), metadata={**episode.metadata, **facts}
    )


def write_record(folder: Path, trial: ControlTrial, settings: ControlSettings, controller: str) -> Path:
    """Write a trial as MCAP: command, truth, measurement, `/reference` and the controller's estimate."""
    from twin.recording.estimate import REFERENCE_TOPIC, estimate_message, estimate_topic
    from twin.recording.messages import to_nanoseconds
    from twin.recording.writer import EpisodeWriter

    episode = record_of(trial, settings, controller)
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
