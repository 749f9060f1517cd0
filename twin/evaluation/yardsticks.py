"""Yardsticks of the full comparison: ensembles of twins along its commands, and bounds on records."""

import hashlib
import io
import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Record
from twin.estimation.ensemble import Ensembles, posterior_bound
from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.method import group_records, make_case
from twin.evaluation.protocol import RECORDED, STEADY_SECONDS, Protocol
from twin.evaluation.scenarios import SAMPLE_TIME, members, simulate_drives
from twin.files.atomic import write_whole
from twin.preset import Preset, Ranges
from twin.signals.noise import fisher_information, noise_bound

Array = NDArray[np.float64]


def make_ensembles(
    preset: Preset,  # parameters that the members have in common
    ranges: Ranges,  # that the others are drawn from
    pulls: Sequence[Array],  # commands (N,) at `SAMPLE_TIME` [m]
    folder: Path,
    *,
    count: int,  # members of each; one that diverges is left out
    seed: int,
    first: int = 0,  # number of the first draw
    physics: str = "reduced",  # or `mujoco`: the same bends to some hundredths of a degree
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> list[Path]:
    """Simulate an ensemble along each command, or find the one of an earlier run.

    There is one `.npz` for each command, named by a hash of all that made it, with `pull_mm` (N,), `bend_deg`
    (members, N) and `sample_time` [s]; `on_progress` is called with finished ensembles, and all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    origin = [__version__, preset.to_dict(), ranges.to_dict(), count, seed, first, SAMPLE_TIME, physics]
    key = json.dumps(origin).encode()
    paths = []
    on_progress(0, len(pulls))
    for finished, pull in enumerate(pulls, start=1):
        name = hashlib.sha256(key + np.ascontiguousarray(pull).tobytes()).hexdigest()[:16]
        path = folder / f"{name}.npz"
        if not path.is_file():
            drives = members(preset, ranges, pull, count, seed, first=first)
            episodes = simulate_drives(drives, physics=physics)
            bend = np.array([episode.truth_deg for episode in episodes if episode is not None], np.float32)
            write_ensemble(path, pull * 1e3, bend, SAMPLE_TIME)
        paths.append(path)
        on_progress(finished, len(pulls))
    return paths


def write_ensemble(path: Path, pull_mm: Array, bend_deg: NDArray[np.float32], sample_time: float) -> None:
    """Write an ensemble along a command: pulls (N,) [mm] and angles (members, N) [deg] at T [s]."""
    buffer = io.BytesIO()
    np.savez(buffer, pull_mm=pull_mm, bend_deg=bend_deg, sample_time=sample_time)
    write_whole(path, buffer.getvalue())


def bounds(
    records: Sequence[Record],
    paths: Sequence[Path],
    sample_time: float,
    conditions: Sequence[tuple[str, float]],
) -> list[dict[str, Any]]:
    """Return the posterior Cramer-Rao bound of each noise that has one, for each stroke.

    `rmse_deg` is its root mean square over a stroke's commands. It is a mean over twins as the ensemble has
    them; the angle of a single twin may be better or worse known.
    """
    ensembles = Ensembles(tuple(paths), sample_time)
    strokes: dict[tuple[float, float], dict[bytes, Record]] = {}
    for record in records:
        strokes.setdefault(record.stroke_mm, {}).setdefault(record.pull_mm.tobytes(), record)
    rows = []
    for (stroke, commands), (kind, level) in itertools.product(strokes.items(), conditions):
        information = None if kind == RECORDED else fisher_information(kind, level)
        if information is None:
            continue
        squares = [
            posterior_bound(ensembles.along(record.pull_mm), information, record.known)[1:] ** 2
            for record in commands.values()
        ]
        rmse = float(np.sqrt(np.concatenate(squares).mean()))
        place = {"noise": kind, "level": level, "sample_time_s": sample_time, "stroke_mm": list(stroke)}
        rows.append({**place, "rmse_deg": rmse})
    return rows


def containment(
    records: Sequence[Record], filters: Mapping[str, SetMembershipFilter], protocol: Protocol
) -> list[dict[str, Any]]:
    """Return how often set-membership intervals hold the truth, by group, bounded noise and filter.

    Rows have `runs_contained` and `samples_contained`, shares of those in which the truth is known, and the
    mean `width_deg` after the first 5 s, where there is such a time.
    """
    drawn = [condition for condition in protocol.conditions if condition[0] != RECORDED]
    bounded = [condition for condition in drawn if np.isfinite(noise_bound(*condition))]
    late = round(STEADY_SECONDS / protocol.sample_time_s)
    rows = []
    for group, condition in itertools.product(group_records(records), bounded):
        case = make_case(group, protocol, [condition])
        assert case.truth_deg is not None
        known = ~np.isnan(case.measurement_deg)
        begin = late if known[:, late:].any() else 0  # a short record has no time after the start
        for name, filter_ in filters.items():
            bounded_filter = filter_.with_sensor(case.sensor)
            low, high = bounded_filter.intervals(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
            inside = ((low <= case.truth_deg) & (case.truth_deg <= high)) | ~known
            rows.append(
                {
                    "method": name,
                    "noise": condition[0],
                    "level": condition[1],
                    "sample_time_s": protocol.sample_time_s,
                    "stroke_mm": list(group[0][1].stroke_mm),
                    "twin": group[0][1].source,
                    "runs_contained": float(inside.all(axis=1).mean()),
                    "samples_contained": float(inside[known].mean()),
                    "width_deg": float((high - low)[:, begin:][known[:, begin:]].mean()),
                }
            )
    return rows
