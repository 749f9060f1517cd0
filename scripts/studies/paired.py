"""One method against each other under each noise: `python -m scripts.studies.paired results/paper`.

It reads the `runs.npz` of an evaluation. Intervals are of 95 %, by the paired bootstrap of
`twin.evaluation.ranking` over trainings, records and draws.
"""

import dataclasses
import sys
from functools import partial
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from scripts.command import Options, Summary, run_verb
from twin.errors import InputError
from twin.evaluation.paper import noise_label
from twin.evaluation.ranking import times_reference
from twin.evaluation.results import load_runs
from twin.report.tables import aligned_table


@dataclasses.dataclass(frozen=True)
class Paired(Options):
    """Compare a method with the others of an evaluation, on the same records and draws."""

    folder: tyro.conf.Positional[Path]
    """Results of `endotwin evaluate`."""
    method: str = "RAM"
    """Method that the others' errors are divided by: above 1, it is better."""
    seed: int = 1
    """Of the bootstrap."""


def paired(args: Paired) -> Summary:
    """Write a table of ratios and their intervals."""
    noises: dict[tuple[str, float], dict[str, NDArray[np.float64]]] = {}
    for head, squares in load_runs(args.folder / "runs.npz"):
        of_noise = noises.setdefault((head.noise, head.level), {})
        if head.method in of_noise:
            raise InputError(f"{args.folder} has more than one group of records: evaluate one alone")
        of_noise[head.method] = squares[:, None]
    methods = list(next(iter(noises.values())))
    if args.method not in methods:
        raise InputError(f"no method {args.method!r} in {args.folder}; there are: {', '.join(methods)}")
    rng = np.random.default_rng(args.seed)
    columns = [times_reference([of], args.method, rng) for of in noises.values()]
    rows = []
    for method in (name for name in methods if name != args.method):
        cells = (of[method] for of in columns)
        rows.append([method, *(f"{ratio:.2f} ({low:.2f} to {high:.2f})" for ratio, (low, high) in cells)])
    labels = [noise_label(*of) for of in noises]
    table = aligned_table(rows, ["error in units of " + args.method, *labels])
    return Summary(f"{args.folder}: {args.method} against {len(rows)} methods", {}, table=table)


main = partial(run_verb, Paired, paired)

if __name__ == "__main__":
    sys.exit(main())
