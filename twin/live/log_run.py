"""A run on a log: each episode streamed through a runtime of its own, recorded and scored."""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode, Record
from twin.errors import InputError
from twin.evaluation.metrics import error_indices
from twin.live.assured import AssuredEstimator
from twin.live.reading import Sink, StreamSample
from twin.preset.sensor import SensorModel
from twin.recording import EpisodeWriter, read_episode
from twin.recording.messages import HEALTH_TOPIC, estimate_message, estimate_topic, health_message
from twin.signals.sensor import estimated_variance

Array = NDArray[np.float64]
SIGN = '"endotwin run"'  # item of the metadata that identifies the recording of a run on a log
PAUSE_S = 1.0  # time between two consecutive episodes in one file [s]
STEADY_S = 5.0  # time from the start of an episode that `rmse_steady_deg` leaves out [s]
PROGRESS_SAMPLES = 100
LEAST_VARIANCE_DEG2 = 1e-3  # of what is estimated: no sensor of a bend is finer


@dataclasses.dataclass(frozen=True)
class LogScores:
    """Errors of a run on a log."""

    # `truth`; `measurement` where no episode has a truth, `truth or measurement` where some have
    against: str
    rmse_deg: float | None  # from the second sample on [deg]; None where there is nothing to compare with
    rmse_steady_deg: float | None  # after the first 5 s [deg]; likewise


def read_logs(files: Mapping[str, Path], sample_time: float) -> list[Record]:
    """Read the samples of episodes, thinned to about a sample time [s]."""
    return [
        dataclasses.replace(
            read_episode(file, hidden=False).record().resampled(sample_time, "nearest"), name=name
        )
        for name, file in files.items()
    ]


def log_targets(out: Path | None, names: Sequence[str]) -> list[Path]:
    """Return the files to write: `out` itself where it ends in .mcap, else one for each episode in it."""
    if out is None:
        return []
    if out.suffix.lower() == ".mcap":
        return [out]
    if out.suffix[1:].isalpha() and not out.is_dir():
        raise InputError(f"out = {out}: must end in .mcap, or name a folder, without an ending")
    return [out / f"{name}.mcap" for name in names]


def run_log(
    files: Mapping[str, Path],
    logs: Sequence[Record],
    targets: Sequence[Path],
    method: str,
    new_runtime: Callable[[], AssuredEstimator],
    sink: Sink,
    facts: Mapping[str, Any],
    on_progress: Callable[[int, int], None],
) -> LogScores:
    """Stream every episode through a runtime; write the targets, each completely or not at all."""
    errors: list[Array] = []
    steady: list[Array] = []
    names, count, end_s = list(files), 0, None
    total = sum(len(log.time) for log in logs)
    groups: list[tuple[Path | None, list[int]]] = [(of, [place]) for place, of in enumerate(targets)]
    if len(targets) != len(logs):
        groups = [(targets[0] if targets else None, list(range(len(logs))))]
    for target, members in groups:
        with contextlib.ExitStack() as opened:
            writer, offsets = None, [0.0] * len(members)
            if target is not None:
                episodes = [read_episode(files[names[member]]) for member in members]
                episode, offsets = joined(episodes, [names[member] for member in members])
                metadata = episode.metadata | {"made_by": SIGN.strip('"'), "run": dict(facts)}
                writer = opened.enter_context(EpisodeWriter(target))
                writer.write(dataclasses.replace(episode, metadata=metadata))
            for member, offset_s in zip(members, offsets, strict=True):
                log, estimates = logs[member], []
                later_s = 0.0 if end_s is None else end_s + PAUSE_S - log.time[0].item()
                end_s = log.time[-1].item() + later_s
                runtime = new_runtime()
                for sample in replay(runtime, log):
                    estimates.append(sample.reading.bend_deg)
                    sink.add(sample._replace(time_s=sample.time_s + later_s))
                    if writer is not None:
                        _add_reading(writer, method, sample, offset_s)
                    count += 1
                    if count % PROGRESS_SAMPLES == 0 or count == total:
                        on_progress(count, total)
                every, late = log_errors(corrected(log, runtime.sensor), np.array(estimates))
                errors.append(every)
                steady.append(late)
    kinds = sorted({"measurement" if log.is_measured else "truth" for log in logs}, reverse=True)
    return LogScores(" or ".join(kinds), _rmse_deg(errors), _rmse_deg(steady))


def replay(runtime: AssuredEstimator, log: Record) -> Iterator[StreamSample]:
    """Yield each sample of a log with its reading, as a live stream of the same samples would have it."""
    columns = (log.time, log.pull_mm, log.measured_deg)
    for time_s, pull_mm, measured in zip(*(column.tolist() for column in columns), strict=True):
        yield StreamSample(time_s, pull_mm, measured, runtime.push(time_s, pull_mm, measured))


def corrected(log: Record, sensor: SensorModel) -> Record:
    """Return a log with the angles that its measurements state."""
    return dataclasses.replace(log, measured_deg=sensor.angles_deg(log.time, log.measured_deg))


def noise_of(logs: Sequence[Record]) -> float | None:
    """Return the variance of the noise of logs, as estimated [deg^2]; None if they are too short."""
    found = [variance for log in logs if math.isfinite(variance := estimated_variance(log.measured_deg))]
    return max(float(np.median(found)), LEAST_VARIANCE_DEG2) if found else None


def log_errors(log: Record, estimate_deg: Array) -> tuple[Array, Array]:
    """Return the errors of the (N,) estimates of a log, and those after `STEADY_S` [deg].

    The first sample, at which the estimate is given, and samples without a reference are left out.
    """
    error = estimate_deg - log.reference_deg
    scored = np.isfinite(error)
    scored[0] = False
    return error[scored], error[scored & (log.time - log.time[0] >= STEADY_S)]


def _rmse_deg(errors: list[Array]) -> float | None:
    error = np.concatenate([*errors, np.empty(0)])
    return float(error_indices(error)["rmse_deg"]) if error.size else None


def _add_reading(writer: EpisodeWriter, method: str, sample: StreamSample, offset_s: float) -> None:
    nanoseconds, reading = round((sample.time_s + offset_s) * 1e9), sample.reading
    estimate = estimate_message(reading.bend_deg, *(reading.interval_deg or ()))
    writer.add_message(estimate_topic(method), estimate, nanoseconds)
    writer.add_message(HEALTH_TOPIC, health_message(reading), nanoseconds)


def joined(episodes: Sequence[Episode], names: Sequence[str]) -> tuple[Episode, list[float]]:
    """Return several episodes as one, a second apart, and how much later each of them is in it [s].

    It contains what all of them have: the metadata where they are equal, the arrays where their columns are.
    `records` in its metadata states the place of each.
    """
    if len(episodes) == 1:
        return episodes[0], [0.0]
    offsets: list[float] = []
    end = -PAUSE_S
    for episode in episodes:
        offsets.append(end + PAUSE_S - float(episode.time[0]))
        end = offsets[-1] + float(episode.time[-1])
    arrays = {}
    for field in dataclasses.fields(Episode):
        parts = [getattr(episode, field.name) for episode in episodes]
        if isinstance(parts[0], np.ndarray) and field.name != "time":
            arrays[field.name] = _joined_arrays(parts)
    arrays["time"] = np.concatenate([e.time + offset for e, offset in zip(episodes, offsets, strict=True)])
    first = episodes[0].metadata
    common = {
        name: value
        for name, value in first.items()
        if all(name in e.metadata and e.metadata[name] == value for e in episodes)
    }
    records = [
        {"name": name, "begins_s": offset + float(episode.time[0]), "samples": len(episode.time)}
        for name, episode, offset in zip(names, episodes, offsets, strict=True)
    ]
    return Episode(**arrays, metadata=common | {"records": records}), offsets


def _joined_arrays(parts: Sequence[Any]) -> Any:
    """Return arrays joined: empty where one was not recorded, without columns where these differ."""
    if not all(len(part) > 0 for part in parts):
        return np.empty(0)
    if len({part.shape[1:] for part in parts}) == 1:
        return np.concatenate(parts)
    wires = [min(part.shape[1] for part in parts)] if parts[0].ndim == 3 else []
    return np.empty((sum(map(len, parts)), *wires, 0))
