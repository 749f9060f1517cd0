"""The limit of the benchmark: ensembles of randomised twins along its commands, simulated once and kept."""

import hashlib
import io
import itertools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.estimation.ensemble import Ensembles, posterior_bound
from twin.evaluation.protocol import RECORDED
from twin.evaluation.record import EvaluationRecord
from twin.files.atomic import write_whole
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.signals.noise import fisher_information
from twin.suite.scenarios import SAMPLE_TIME, members, simulate_drives

Array = NDArray[np.float64]


def make_ensembles(
    preset: Preset,
    ranges: Ranges,
    pulls: Sequence[Array],
    folder: Path,
    *,
    count: int,
    seed: int,
    first: int = 0,
    physics: str = "reduced",
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Simulate an ensemble along each command, or find the one that an earlier run has kept.

    Args:
        preset: what the members have in common.
        ranges: what they are drawn from.
        pulls: commands (N,) at `SAMPLE_TIME` [m].
        folder: where the ensembles are kept, each under a name that tells what made it.
        count: members of each; one that diverges is left out.
        seed: of the draws.
        first: number of the first draw.
        physics: the twin that members are, `reduced` or `mujoco`: the same bends to some hundredths of a
            degree, and a hundred times the wait.
        on_progress: told how many of how many ensembles are there.

    Returns:
        One `.npz` for each command, with `pull_mm` (N,), `bend_deg` (members, N) and `sample_time` [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    made_from = [__version__, preset.to_dict(), ranges.to_dict(), count, seed, first, SAMPLE_TIME, physics]
    origin = json.dumps(made_from).encode()
    paths = []
    if on_progress:
        on_progress(0, len(pulls))
    for done, pull in enumerate(pulls, start=1):
        name = hashlib.sha256(origin + np.ascontiguousarray(pull).tobytes()).hexdigest()[:16]
        path = folder / f"{name}.npz"
        if not path.is_file():
            drives = members(preset, ranges, pull, count, seed, first=first)
            episodes = simulate_drives(drives, physics=physics)
            bend = np.array([episode.truth_deg for episode in episodes if episode is not None], np.float32)
            buffer = io.BytesIO()
            np.savez(buffer, pull_mm=pull * 1e3, bend_deg=bend, sample_time=SAMPLE_TIME)
            write_whole(path, buffer.getvalue())
        paths.append(path)
        if on_progress:
            on_progress(done, len(pulls))
    return paths


def bounds(
    records: Sequence[EvaluationRecord],
    paths: Sequence[Path],
    sample_time: float,
    conditions: Sequence[tuple[str, float]],
) -> list[dict[str, Any]]:
    """Return the posterior Cramer-Rao bound of each noise that has one, for each stroke.

    `rmse_deg` is its root mean square over a stroke's commands. It is a mean over twins as the ensemble has
    them; a single twin may be better or worse known.
    """
    ensembles = Ensembles(tuple(paths), sample_time)
    strokes: dict[tuple[float, float], dict[bytes, EvaluationRecord]] = {}
    for record in records:
        strokes.setdefault(record.stroke_mm, {}).setdefault(record.pull_mm.tobytes(), record)
    rows = []
    for (stroke, commands), (kind, level) in itertools.product(strokes.items(), conditions):
        information = None if kind == RECORDED else fisher_information(kind, level)
        if information is None:
            continue
        squares = [
            posterior_bound(ensembles.along(record.pull_mm), information, record.seen)[1:] ** 2
            for record in commands.values()
        ]
        rows.append(
            {
                "noise": kind,
                "level": level,
                "sample_time_s": sample_time,
                "stroke_mm": list(stroke),
                "rmse_deg": float(np.sqrt(np.concatenate(squares).mean())),
            }
        )
    return rows
