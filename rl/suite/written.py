"""Files that a comparison may write, and the sign by which each is known as ours."""

from twin.files.atomic import MADE_BY
from twin.report.comparison import page_names

SCORES = "scores.csv"
COSTS = "costs.csv"
_RESULTS = {"evaluation.json": '"protocol"', "tracks.npz": "heads.npy", "runs.npz": "heads.npy"}
_FIGURES = [f"figure_{number:02d}.png" for number in range(100)]
_FULL = ["benchmark.md", "rmse_by_noise.png", "times_the_limit.png", "ranks.png", "intervals.png", *_FIGURES]

PAPER_FILES = _RESULTS | dict.fromkeys(["tables.md", "rmse.png", *_FIGURES], MADE_BY)
"""Files of the paper's suite."""


def full_files() -> dict[str, str]:
    """Return the files of the full suite, with a page for each condition."""
    tables = {SCORES: "method,oracle,noise", COSTS: "method,sample_us"}
    return _RESULTS | tables | dict.fromkeys([*_FULL, *page_names()], MADE_BY)
