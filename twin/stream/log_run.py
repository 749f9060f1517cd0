"""A run on a log: each record streamed through a runtime of its own, recorded and scored."""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.recording import read_episode
from twin.runtime.assured import AssuredEstimator
from twin.stream.log_recording import PAUSE_S, LogRecording, joined
from twin.stream.replay import StreamLog, log_errors, log_of, replay, rmse_deg
from twin.stream.sample import Sink

Array = NDArray[np.float64]
OnProgress = Callable[[int, int], None]
TOLD_EVERY = 100  # samples


@dataclasses.dataclass(frozen=True)
class LogRun:
    """Records that are run on, by name, and the files that the runs are recorded in.

    Attributes:
        files: MCAP file of each record, by its name.
        logs: samples of each, in the same order.
        targets: files to write; one for each record, one for all together, or none.
    """

    files: Mapping[str, Path]
    logs: Sequence[StreamLog]
    targets: Sequence[Path]

    @property
    def samples(self) -> int:
        """Number of samples of all records."""
        return sum(len(log.time_s) for log in self.logs)

    def groups(self) -> Iterator[tuple[Path | None, list[int]]]:
        """Yield each file to write, None for none, and the records in it by number."""
        every = range(len(self.logs))
        if len(self.targets) == len(self.logs):
            yield from ((target, [number]) for target, number in zip(self.targets, every, strict=True))
        else:
            yield (self.targets[0] if self.targets else None), list(every)


@dataclasses.dataclass(frozen=True)
class LogScores:
    """Errors of a run on a log.

    Attributes:
        against: `truth`; `measurement` where no record has a truth, `truth or measurement` where some have.
        rmse_deg: from the second sample on [deg]; None where nothing is known to compare with.
        rmse_steady_deg: after the first 5 s [deg]; likewise.
    """

    against: str
    rmse_deg: float | None
    rmse_steady_deg: float | None


def read_logs(files: Mapping[str, Path], sample_time: float) -> list[StreamLog]:
    """Read the samples of records, thinned to about a sample time.

    Raises:
        FileNotFoundError: a file is not there.
        ValueError: one is damaged.
    """
    return [
        dataclasses.replace(log_of(read_episode(file, hidden=False), number, sample_time), name=name)
        for number, (name, file) in enumerate(files.items())
    ]


def run_log(
    run: LogRun,
    method: str,
    new_runtime: Callable[[], AssuredEstimator],
    sink: Sink,
    facts: Mapping[str, Any],
    on_progress: OnProgress,
) -> LogScores:
    """Stream every record through a runtime; write the targets, each whole or not at all.

    Args:
        run: records and targets.
        method: name of the trained method.
        new_runtime: makes a runtime before its first sample.
        sink: takes each sample, besides the recording; for it, records follow one another in time.
        facts: of the run, for the metadata of the recordings.
        on_progress: told the samples so far and all of them.

    Raises:
        ValueError: a file has changed meanwhile, or its record does not fit the format.
        OSError: a target cannot be written.
    """
    errors: list[Array] = []
    steady: list[Array] = []
    names, done, end_s = list(run.files), 0, None
    for target, members in run.groups():
        with contextlib.ExitStack() as opened:
            recording, offsets = None, [0.0] * len(members)
            if target is not None:
                episodes = [read_episode(run.files[names[member]]) for member in members]
                episode, offsets = joined(episodes, [names[member] for member in members])
                recording = opened.enter_context(LogRecording(target, episode, method, facts))
            for member, offset_s in zip(members, offsets, strict=True):
                log, bend_deg = run.logs[member], []
                if recording is not None:
                    recording.offset_s = offset_s
                later_s = 0.0 if end_s is None else end_s + PAUSE_S - log.time_s[0].item()
                end_s = log.time_s[-1].item() + later_s
                for sample in replay(new_runtime(), log):
                    bend_deg.append(sample.reading.bend_deg)
                    sink.add(sample._replace(time_s=sample.time_s + later_s))
                    if recording is not None:
                        recording.add(sample)
                    done += 1
                    if done % TOLD_EVERY == 0 or done == run.samples:
                        on_progress(done, run.samples)
                every, late = log_errors(log, np.array(bend_deg))
                errors.append(every)
                steady.append(late)
    kinds = sorted({"measurement" if log.is_measured else "truth" for log in run.logs}, reverse=True)
    return LogScores(" or ".join(kinds), rmse_deg(errors), rmse_deg(steady))


def log_targets(out: Path | None, names: Sequence[str]) -> list[Path]:
    """Return the files to write: `out` itself where it ends in .mcap, else one for each record in it.

    Raises:
        ValueError: it has another ending, as a file of another kind would have, and is no folder.
    """
    if out is None:
        return []
    if out.suffix.lower() == ".mcap":
        return [out]
    if out.suffix[1:].isalpha() and not out.is_dir():
        raise InputError(f"out = {out}: must end in .mcap, or name a folder, without an ending")
    return [out / f"{name}.mcap" for name in names]
