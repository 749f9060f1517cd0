"""Accuracy: the policy is not worse than the tuned active model, on unseen twins and on the logs."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator
from twin.estimation.learned.policy import PolicyEstimator
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.estimation.learned.ram_twins import FILTER_ALONE, RamTwins
from twin.evaluation.paper import noise_label
from twin.gate.material import WIDER, GateMaterial
from twin.gate.paired import Paired, compare_paired
from twin.gate.result import Check, not_shown
from twin.gate.rival import RIVAL
from twin.gate.trial import PairedTrial

Array = NDArray[np.float64]
ON_TWINS, ON_WIDER, ON_LOGS = "accuracy on held-out twins", "accuracy on wider twins", "accuracy on the logs"
LEARNING = "worth of what was learned"
BAR = 0.0
"""Upper end of the difference's interval, relative to the rival: not above it, being worse is excluded."""
WORTH = -0.10
"""The same of what was learned, which must be worth something: an untrained policy is as good as none."""


def on_held_out_twins(material: GateMaterial) -> Check:
    """Compare on twins drawn from the ranges of the preset."""
    return _compared(ON_TWINS, material.held_out, material, "twins drawn from the preset's ranges")


def on_wider_twins(material: GateMaterial) -> Check:
    """Compare on twins drawn from ranges that are wider."""
    return _compared(ON_WIDER, material.wider, material, f"twins drawn from ranges {WIDER:g} times wider")


def on_logs(material: GateMaterial) -> Check:
    """Compare on the user's logs, with noise drawn on their angles."""
    if not material.logs:
        return not_shown(ON_LOGS, "no log was given: nothing is known of the real endoscope")
    check = _compared(ON_LOGS, material.on_logs, material, "the logs")
    count = len(material.logs)
    notes = [
        f"Noise is drawn on the {'measured' if any(log.is_measured for log in material.logs) else 'true'} "
        "angles of the logs, which are taken for the truth."
    ]
    if count < 5:
        notes.append(f"{count} log{'s' * (count > 1)}: the interval says little of other logs.")
    return dataclasses.replace(check, notes=(*check.notes, *notes))


def _compared(name: str, trials: Sequence[PairedTrial], material: GateMaterial, what: str) -> Check:
    """Return the check of a set of trials: by noise over all units, and by kind of unit over all noises."""
    rng = material.resampling
    rows: list[dict[str, Any]] = []
    for trial in trials:
        rows.append(_row("noise", noise_label(*trial.noise), compare_paired(trial.squares, trial.rival, rng)))
    for unit in dict.fromkeys(trials[0].units):
        mine = [place for place, of in enumerate(trials[0].units) if of == unit]
        squares, rival = (
            np.concatenate([getattr(trial, of)[mine] for trial in trials], axis=1)
            for of in ("squares", "rival")
        )
        label = unit if isinstance(unit, str) else f"[{unit[0]:g}, {unit[1]:g}] mm"
        kind = "log" if isinstance(unit, str) else "stroke"
        rows.append(_row(kind, label, compare_paired(squares, rival, rng)))
    # Of single logs the interval is that of the noise alone: they are shown, the noises decide.
    judged = [row for row in rows if row["of"] != "log"]
    worst = max(judged, key=lambda row: row["relative_high"])
    finite = all(trial.finite for trial in trials)
    holds = finite and worst["relative_high"] <= BAR
    if not finite:
        said = f"on {what} an estimate is not a number"
    elif holds:
        said = (
            f"on {what} its RMSE is below that of {RIVAL} under every noise; nearest under {worst['what']}: "
            f"{worst['rmse_deg']:.2f} against {worst['rival_deg']:.2f} deg"
        )
    else:
        failed = sum(row["relative_high"] > BAR for row in judged)
        said = (
            f"on {what} it is worse than {RIVAL}, or that is not excluded, in {failed} of {len(judged)} "
            f"comparisons; worst with {worst['what']}: {worst['rmse_deg']:.2f} against "
            f"{worst['rival_deg']:.2f} deg"
        )
    units, draws = trials[0].squares.shape
    left_out = trials[0].left_out
    notes = [
        f"{units} units and {draws} draws of each noise; intervals by a hierarchical bootstrap over both.",
        f"{RIVAL}: Coleman-Hodgdon identified on simulated records of the preset, Q and P by likelihood, R "
        "told.",
    ]
    if left_out:
        notes.append(f"{left_out} twins found no equilibrium and were left out.")
    return Check(
        name,
        said,
        figure=worst["relative_high"],
        bar=BAR,
        unit="of the rival's RMSE, upper end",
        holds=holds,
        rows=tuple(rows),
        notes=tuple(notes),
    )


def _row(kind: str, what: str, found: Paired) -> dict[str, Any]:
    return {"of": kind, "what": what, **found._asdict(), "relative_high": found.relative_high}


def learning_helps(material: GateMaterial) -> Check:
    """Compare with the same file without its learned parts: what was learned must be worth its risk."""
    alone = without_learning(material.estimator)
    if alone is None:
        return not_shown(LEARNING, "nothing is left of this method without what it has learned")
    trials = material.against(alone)
    squares, rival = (
        np.concatenate([getattr(trial, of) for trial in trials], axis=1) for of in ("squares", "rival")
    )
    rng = material.resampling
    found = compare_paired(squares, rival, rng)
    holds = found.relative_high <= WORTH
    said = (
        f"over all noises {found.rmse_deg:.2f} deg with what was learned, {found.rival_deg:.2f} deg without"
        if holds
        else f"what was learned is worth nothing, or hardly anything: {found.rmse_deg:.2f} deg with it, "
        f"{found.rival_deg:.2f} deg without: is the policy untrained?"
    )
    return Check(
        LEARNING,
        said,
        figure=found.relative_high,
        bar=WORTH,
        unit="of the RMSE without it, upper end",
        holds=holds,
        rows=tuple(
            _row(
                "noise",
                noise_label(*trial.noise),
                compare_paired(trial.squares, trial.rival, material.resampling),
            )
            for trial in trials
        ),
        notes=("The same filter in the same file, whose policy and recogniser say nothing.",),
    )


def without_learning(estimator: Estimator[Any]) -> Estimator[Any] | None:
    """Return the filter that is left of an estimator without what it has learned; None, where none is."""
    if isinstance(estimator, RamTwins):
        return dataclasses.replace(estimator, parts=FILTER_ALONE)
    if isinstance(estimator, PolicyEstimator) and estimator.make_agent is ReinforcementActiveModel:
        of_policy: ActiveModel = estimator.active_model
        return of_policy
    return None
