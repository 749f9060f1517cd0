"""A row of an evaluation, to be changed by `dataclasses.replace`."""

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
