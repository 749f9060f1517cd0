"""Accuracy and calibration of the policy, on unseen twins and on the logs.

Accuracy is compared with the tuned active model's; the stated 95 % interval is tested by its coverage, the
NEES of the estimate and the NIS of the prediction (Bar-Shalom et al. 2001).
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned.methods import RAM
from twin.estimation.learned.ram_twins import RamTwins
from twin.estimation.learned.step import FILTER_ALONE, LearnedStep
from twin.evaluation.method import with_innovations
from twin.evaluation.paper import noise_label
from twin.gate.check import ACCURACY, CALIBRATION, GIVE_LOGS, NOTHING, Check, declare, not_shown
from twin.gate.evidence import OTHER_STREAMS, RIVAL, WIDER, GateMaterial, noisy
from twin.gate.trial import LEAST_UNITS, PairedTrial, compare_paired, mean_interval

Array = NDArray[np.float64]
BAR = 0.0  # upper end of the difference's interval, relative to the rival: at most 0, it is not worse
WORTH = -0.03
"""The same for the learned part, against the policy without it: if it gains less, it can be left out."""
LEAST_COVERAGE = 0.90  # least share of samples in a 95 % interval, under each noise
MOST_NEES = MOST_NIS = 2.0  # normalised squares beyond which errors are 1.4 times as large as stated
NIS_NOISES = (("gaussian", 1.0), ("laplace", 1.0), ("uniform", 1.0))  # noises without a mean
ALL_NOISES = "all noises"
_STREAM = OTHER_STREAMS + 1
_SETTLING_S = 5.0  # before which a filter has seen too little to predict
BETTER = "Train on the ranges of this preset, or deploy the tuned filter, which is as good."
STATES_NONE = "Use a method that states one, such as RAM (twins)."
INTERVAL = (
    "Do not use the interval: state R and the zero of the sensor as they are, and train on wider ranges."
)
_NOT_STATED = "this method states no interval of its own"


@declare("accuracy on held-out twins", ACCURACY, BETTER, 35)
def on_held_out_twins(material: GateMaterial) -> Check:
    """On endoscopes of this kind the policy is not worse than the trusted filter."""
    return _compared(material.held_out, material, "twins drawn from the preset's ranges")


@declare(
    "accuracy on wider twins",
    ACCURACY,
    "Widen the ranges of the preset and train again on them, or deploy the tuned filter.",
    25,
)
def on_wider_twins(material: GateMaterial) -> Check:
    """Nor on endoscopes that differ more than the ranges."""
    return _compared(material.wider, material, f"twins drawn from ranges {WIDER:g} times wider")


@declare("accuracy on the logs", ACCURACY, "Calibrate the preset on these logs, and train again on it.", 10)
def on_logs(material: GateMaterial) -> Check:
    """On the logs of this endoscope it is not worse either."""
    if not material.logs:
        return not_shown("no log was given: nothing is known about the real endoscope", GIVE_LOGS)
    check = _compared(material.on_logs, material, "the logs")
    kind = "measured" if any(log.is_measured for log in material.logs) else "true"
    notes = [f"Noise is drawn on the {kind} angles of the logs, which count as the truth."]
    if len(material.logs) < 5:
        notes.append(f"With {len(material.logs)} of them the interval shows little about other logs.")
    return check.model_copy(update={"notes": (*check.notes, *notes)})


def _compared(trials: Sequence[PairedTrial], material: GateMaterial, what: str) -> Check:
    """Return the check of a set of trials: by noise over all units, and by kind of unit over all noises."""
    rows = [_row("noise", noise_label(*of.noise), of.squares, of.rival) for of in trials]
    squares, rival = _all_noises(trials)
    for unit in dict.fromkeys(trials[0].units):
        mine = [place for place, of in enumerate(trials[0].units) if of == unit]
        if isinstance(unit, str):
            rows.append(_row("log", unit, squares[mine], rival[mine]))
        else:
            rows.append(_row("stroke", f"[{unit[0]:g}, {unit[1]:g}] mm", squares[mine], rival[mine]))
    judged, scope = [row for row in rows if row["of"] != "log"], "under every noise"
    if isinstance(trials[0].units[0], str):
        # A few logs show little under one noise: all noises together decide, and no noise may be shown worse.
        rows.append(_row("noise", ALL_NOISES, squares, rival))
        judged = [rows[-1], *(row for row in judged if row["low_deg"] > 0)]
        scope = "over all noises"
    worst = max(judged, key=lambda row: row["relative_high"])
    finite = all(trial.finite for trial in trials)
    failed = sum(row["relative_high"] > BAR for row in judged)
    figures = f"{worst['what']}: {worst['rmse_deg']:.2f} against {worst['rival_deg']:.2f} deg"
    if not finite:
        said = f"on {what} an estimate is not a number"
    elif not failed:
        said = f"on {what} its RMSE is below that of {RIVAL} {scope}; nearest under {figures}"
    else:
        said = (
            f"on {what} it is not shown to be better than {RIVAL} in {failed} of {len(judged)} comparisons; "
            f"worst with {figures}"
        )
    units, draws = trials[0].squares.shape
    over = "units" if units >= LEAST_UNITS else "draws"
    notes = [
        f"{units} units and {draws} draws of each noise; intervals by a jackknife over {over}.",
        f"{RIVAL}: Coleman-Hodgdon identified on simulated records of the preset, Q and P by likelihood, R "
        "known.",
    ]
    if trials[0].left_out:
        notes.append(f"{trials[0].left_out} twins found no equilibrium and were left out.")
    return Check(
        said=said,
        figure=worst["relative_high"],
        bar=BAR,
        unit="of the rival's RMSE, upper end",
        holds=finite and not failed,
        rows=tuple(rows),
        notes=tuple(notes),
    )


def _all_noises(trials: Sequence[PairedTrial]) -> tuple[Array, Array]:
    """Return the (units, noises and draws) mean square errors of the policy and of its rival [deg^2]."""
    mine = np.concatenate([trial.squares for trial in trials], axis=1)
    return mine, np.concatenate([trial.rival for trial in trials], axis=1)


def _row(kind: str, what: str, squares: Any, rival: Any) -> dict[str, Any]:
    found = compare_paired(squares, rival)
    return {"of": kind, "what": what, **found._asdict(), "relative_high": found.relative_high}


@declare("worth of what was learned", ACCURACY, "Train for longer: this file was hardly trained.", 15)
def learning_helps(material: GateMaterial) -> Check:
    """What was learned is worth its risk."""
    alone = without_learning(material.estimator)
    if alone is None:
        return not_shown("nothing is left of this method without what it has learned", NOTHING)
    trials = material.calibrated(alone)
    found = compare_paired(*_all_noises(trials))
    holds = found.relative_high <= WORTH
    said = (
        f"over all noises {found.rmse_deg:.2f} deg with what was learned, {found.rival_deg:.2f} deg without"
        if holds
        else f"what was learned is worth nothing, or hardly anything: {found.rmse_deg:.2f} deg with it, "
        f"{found.rival_deg:.2f} deg without: is it untrained?"
    )
    return Check(
        said=said,
        figure=found.relative_high,
        bar=WORTH,
        unit="of the RMSE without it, upper end",
        holds=holds,
        rows=tuple(_row("noise", noise_label(*of.noise), of.squares, of.rival) for of in trials),
        notes=(
            "The rival is the same filter in the same file, without what was learned.",
            "The zero of the sensor is known here: an unknown one hides what concerns the noise.",
        ),
    )


@declare("coverage of the interval", CALIBRATION, INTERVAL)
def coverage(material: GateMaterial) -> Check:
    """The stated 95 % interval covers the truth as often as it should."""
    rows: list[dict[str, Any]] = []
    for name, trials in _sets(material).items():
        stated = [(noise_label(*of.noise), of.inside) for of in trials if of.inside is not None]
        if stated:
            stated.append((ALL_NOISES, np.concatenate([inside for _, inside in stated], axis=1)))
        for what, inside in stated:
            low, high = np.clip(mean_interval(inside), 0.0, 1.0).tolist()
            judged = float(inside.mean()) if what == ALL_NOISES else high
            rows.append(
                {
                    "set": name,
                    "what": what,
                    "inside": float(inside.mean()),
                    "low": low,
                    "high": high,
                    "judged": judged,
                }
            )
    if not rows:
        return not_shown(_NOT_STATED, STATES_NONE)
    worst = min(rows, key=lambda row: row["judged"])
    holds = worst["judged"] >= LEAST_COVERAGE
    least = "or more; least" if holds else "only,"
    return Check(
        said=f"its 95 % interval covers the truth in {worst['inside']:.1%} of the samples {least} on "
        f"{worst['set']} under {worst['what']}",
        figure=worst["judged"],
        bar=LEAST_COVERAGE,
        relation="at least",
        unit="share of samples",
        holds=holds,
        rows=tuple(rows),
        notes=(
            "Samples of one run are not independent: the share is a mean over runs, its 95 % interval by a "
            "jackknife.",
            "The mean over all noises must reach the bar; under one noise, the upper end of the interval.",
        ),
    )


@declare("NEES of the interval", CALIBRATION, INTERVAL)
def nees(material: GateMaterial) -> Check:
    """Errors are as large as the interval states."""
    rows: tuple[dict[str, Any], ...] = tuple(
        {
            "set": name,
            "what": noise_label(*trial.noise),
            "nees": float(trial.nees.mean()),
            "half_width_deg": float(trial.half_width_deg.mean()),
        }
        for name, trials in _sets(material).items()
        for trial in trials
        if trial.nees is not None and trial.half_width_deg is not None
    )
    if not rows:
        return not_shown(_NOT_STATED, STATES_NONE)
    worst = max(rows, key=lambda row: row["nees"])
    what = f"on {worst['set']} under {worst['what']}"
    return _normalised(worst["nees"], MOST_NEES, what, "errors", "its interval states", rows)


def _sets(material: GateMaterial) -> dict[str, list[PairedTrial]]:
    return {"held-out twins": material.held_out, "wider twins": material.wider, "the logs": material.on_logs}


@declare("NIS of the prediction", CALIBRATION, INTERVAL, 4)
def nis(material: GateMaterial) -> Check:
    """Innovations are as large as prediction and sensor state."""
    estimator = material.estimator
    if not estimator.states_interval:
        return not_shown(_NOT_STATED, STATES_NONE)
    rng, first = material.random(_STREAM), max(round(_SETTLING_S / material.sample_time), 1)
    records, _ = material.twins(material.ranges, rng, seconds=material.size.seconds, kinds=2, count=2)
    rows: list[dict[str, Any]] = []
    for noise in NIS_NOISES:
        case = noisy(records, noise, 1, 0.0, rng)  # calibrated: an innovation has no zero in it
        variance = np.asarray(case.sensor.variance)
        squares = with_innovations(
            estimator.with_sensor(Sensor(variance, 0.0)),
            case.pull_mm.T,
            case.measurement_deg.T,
            np.asarray(case.initial_bend_deg),
            variance,
            range(first, case.pull_mm.shape[1]),
        )[2]
        rows.append({"what": noise_label(*noise), "nis": float(np.mean(squares))})
        material.on_progress(len(rows) / len(NIS_NOISES))
    worst = max(rows, key=lambda row: row["nis"])
    what, notes = f"under {worst['what']}", ("Without a measurement the estimator states its prediction.",)
    stated = "prediction and sensor state"
    return _normalised(worst["nis"], MOST_NIS, what, "its innovations", stated, rows, notes)


def _normalised(
    found: float,
    bar: float,
    what: str,
    errors: str,
    stated: str,
    rows: Sequence[dict[str, Any]],
    notes: tuple[str, ...] = (),
) -> Check:
    holds = found <= bar
    return Check(
        said=f"at most {found:.2f}, {what}; 1 is right"
        if holds
        else f"{errors} are {np.sqrt(found):.1f} times as large as {stated}, {what}",
        figure=found,
        bar=bar,
        unit="stated variances",
        holds=holds,
        rows=tuple(rows),
        notes=notes,
    )


def without_learning(estimator: Estimator[Any]) -> Estimator[Any] | None:
    """Return an estimator without its learned part; None if nothing is left."""
    if isinstance(estimator, RamTwins):
        return dataclasses.replace(estimator, parts=FILTER_ALONE)
    if isinstance(estimator, LearnedStep) and estimator.network.file.agent == RAM.agent:
        assert estimator.model is not None
        return ActiveModel(estimator.model, estimator.sample_time)
    return None
