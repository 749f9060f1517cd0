"""What a small `dataset.json` holds."""

FIGURES = {"count": 2, "max": 1.0, "mean": 0.5, "min": 0.0, "std": 0.5}
FILE = {
    "name": "a.mcap",
    "samples": 2,
    "seconds": 0.2,
    "bytes": 99,
    "sha256": "0" * 64,
    "statistics": {"truth_deg": FIGURES},
    "csv": "a.csv",
    "csv_sha256": "1" * 64,
}
FEATURE = {"topic": "/truth", "field": "truth_deg", "unit": "deg", "shape": [], "meaning": "bend"}


def contents(**changes) -> dict:
    """Contents of a dataset of one measured log, some of them changed."""
    return {
        "source": "measured",
        "endotwin": "1",
        "episodes": 1,
        "seconds": 0.2,
        "bytes": 99,
        "features": {"truth_deg": FEATURE},
        "statistics": {"truth_deg": FIGURES},
        "files": [FILE],
    } | changes
