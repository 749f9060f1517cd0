"""One method against each other under each noise: `python docs/examples/paired.py results/paper RAM`.

Errors are ratios to those of the method: above 1, it is better. Intervals are of 95 %, by a paired jackknife
over trainings and records.
"""

import sys
from pathlib import Path

import numpy as np

from twin.evaluation.paper import noise_label
from twin.evaluation.ranking import times_reference
from twin.evaluation.results import load_runs
from twin.report.tables import aligned_table

folder, method = Path(sys.argv[1]), sys.argv[2]
noises: dict[str, dict[str, np.ndarray]] = {}
for head, squares in load_runs(folder / "runs.npz"):
    noises.setdefault(noise_label(head.noise, head.level), {})[head.method] = squares[:, None]
columns = [times_reference([squares], method) for squares in noises.values()]
rows = []
for other in (name for name in columns[0] if name != method):
    cells = (of[other] for of in columns)
    rows.append([other, *(f"{ratio:.2f} ({low:.2f} to {high:.2f})" for ratio, (low, high) in cells)])
print(aligned_table(rows, [f"error / that of {method}", *noises]))
