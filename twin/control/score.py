"""Scores of controllers: errors by condition, reference and stroke, and ours against each other one."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.control.condition import ControlCondition
from twin.control.registry import is_oracle
from twin.control.trial import ControlTrial
from twin.evaluation.metrics import confidence_interval
from twin.gate.trial import reduction_interval

Array = NDArray[np.float64]
MEASURES = (
    "rmse_deg",
    "worst_deg",
    "late_rmse_deg",
    "late_worst_deg",
    "travel_mm",
    "estimate_rmse_deg",
    "fallback_share",
)


@dataclasses.dataclass(frozen=True)
class ControlResult:
    """Measures of all trials of one controller under one condition.

    Attributes:
        controller: its name.
        condition: under which.
        strokes_mm: strokes, in the order of the first axis.
        measures: by the names of `MEASURES`, each (strokes, twins, signals).
        settings: what was tuned for it.
    """

    controller: str
    condition: ControlCondition
    strokes_mm: tuple[tuple[float, float], ...]
    measures: dict[str, Array]
    settings: dict[str, float]

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
        """Return what all trials together come to; late values are of the last 20 s."""
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
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each signal and stroke."""
        condition, rows = self.condition, []
        for s, stroke in enumerate(self.strokes_mm):
            for k, signal in enumerate(condition.signals):
                mine = {name: values[s, :, k] for name, values in self.measures.items()}
                low, high = confidence_interval(mine["rmse_deg"])
                estimate = float(mine["estimate_rmse_deg"].mean())
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
                        "rmse_deg": float(mine["rmse_deg"].mean()),
                        "rmse_ci95_deg": [low, high],
                        "worst_twin_rmse_deg": float(mine["rmse_deg"].max()),
                        "worst_deg": float(mine["worst_deg"].max()),
                        "late_rmse_deg": float(mine["late_rmse_deg"].mean()),
                        "late_worst_deg": float(mine["late_worst_deg"].max()),
                        "travel_mm": float(mine["travel_mm"].mean()),
                        "estimate_rmse_deg": estimate if estimate >= 0 else None,
                        "fallback_share": float(mine["fallback_share"].mean()),
                    }
                )
        return rows


def measures_of(trial: ControlTrial) -> tuple[float, ...]:
    """Return the measures of a trial, in the order of `MEASURES`; -1 where nothing was estimated."""
    off = (trial.estimate_deg - trial.bend_deg)[trial.scored]
    estimate = float(np.sqrt(np.mean(off**2)))
    return (
        trial.rmse_deg,
        trial.worst_deg,
        float(np.sqrt(np.mean(trial.late_error_deg**2))),
        float(np.abs(trial.late_error_deg).max()),
        trial.travel_mm,
        estimate if np.isfinite(estimate) else -1.0,
        float(trial.fell_back[trial.scored].mean()),
    )


def comparisons(results: Sequence[ControlResult], ours: str, seed: int) -> list[dict[str, Any]]:
    """Return how much less error ours has than each other controller, under each condition; oracles are none.

    The 95 % interval is paired: both saw the same twins, references and noise.
    """
    found = []
    for result in results:
        if result.controller != ours:
            continue
        for other in results:
            if other.condition != result.condition or other.controller == ours or is_oracle(other.controller):
                continue
            interval = reduction_interval(result.squares, other.squares, np.random.default_rng(seed))
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
