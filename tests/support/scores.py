"""A row of an evaluation, to be changed by `dataclasses.replace`, and test records."""

import numpy as np

from twin.episode import Record
from twin.evaluation.score import Score

SCORE = Score(
    noise="gaussian",
    level=1.0,
    sample_time_s=0.1,
    stroke_mm=(-1.0, 1.0),
    method="RAM",
    oracle=False,
    mae_deg=0.5,
    rmse_deg=0.6,
    md_deg=0.4,
    var_deg2=0.2,
    bias_deg=-0.1,
    rmse_steady_deg=0.55,
    rmse_ci95_deg=(0.58, 0.62),
    seeds=20,
)


def track(time, truth_deg, measured_deg, estimates):
    """A record with estimates, as a comparison returns it."""
    return Record(time, truth_deg, truth_deg, measured_deg, estimates=estimates)


def simulated_record(pull_mm, truth_deg, seen=True, source="nominal", stroke_mm=(2.0, 4.0), name="0", T=0.1):
    """A record of a twin whose true angle is known where it is `seen`."""
    time = T * np.arange(len(pull_mm))
    truth = np.where(seen, truth_deg, np.nan)
    return Record(time, np.asarray(pull_mm), truth, name=name, source=source, stroke_mm=stroke_mm)
