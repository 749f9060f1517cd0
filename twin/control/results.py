"""Files of a comparison of controllers: `control.json`, a table, and recordings of what figures show."""

import dataclasses
import json
from collections.abc import Mapping
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
from twin.simulation import simulate

RESULTS = "control.json"
RECORDS = "records"
RECORD_SIGN = "tracking_rmse_deg"
"""Metadata that no other recording has."""


def control_values(
    comparison: Comparison, settings: ControlSettings, ours: str | None, origin: Mapping[str, Any]
) -> dict[str, Any]:
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
        "preview_s": settings.preview_s,
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
        "origin": dict(origin),
    }


def write_values(folder: Path, values: dict[str, Any]) -> Path:
    """Write `control.json`; returns its path."""
    path = folder / RESULTS
    write_whole(path, json.dumps(values, indent=1) + "\n")
    return path


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
