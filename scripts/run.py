"""`endotwin run`: a trained estimator on a log or on a live stream, sample by sample."""

import contextlib
import dataclasses
import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from scripts.command import (
    Stopped,
    Summary,
    UninterruptedStep,
    complain,
    describe_error,
    exit_status,
    run_verb,
    stream_line,
)
from scripts.outputs import output_file, output_folder
from scripts.progress import Progress
from scripts.run_sinks import Pace, Sinks, live_recording, live_viewer
from twin.errors import InputError

if TYPE_CHECKING:
    from twin.control.live import LiveCommands
    from twin.runtime import AssuredEstimator
    from twin.stream import Sink


@dataclasses.dataclass(frozen=True)
class Run:
    """Run a trained estimator sample by sample: on a log, or live on JSON lines from stdin to stdout.

    Live, each line in is a sample, {"time_s": 0.1, "pull_mm": 0.2, "measurement_deg": 1.3}. It is answered by
    one line with the estimate, its 95 % interval, who made it, and health; docs/deployment.md has all of it.
    """

    data: tyro.conf.Positional[tuple[Path, ...]] = ()
    """A log: folders of MCAP files, or files. Without it, live."""
    policy: Path = dataclasses.field(kw_only=True)
    """Trained file of any method, as `endotwin train` writes it."""
    out: Path | None = None
    """Recording of the run: NAME.mcap, in which several records of a log follow one another; or, for a log, a
    folder, with a file for each record."""
    sample_time: float | None = None
    """T [s]; that of the training, if not given. A log is thinned to about it."""
    noise_variance: float = 0.1
    """R of the sensor [deg^2]."""
    initial_bend_deg: float = 0.0
    """Estimate at the first sample [deg]."""
    stroke: tuple[float, float] | None = None
    """Live: lowest and highest pull that may be commanded [mm]. With it, lines with "reference_deg" are
    answered with "command_mm", the pull to command at the next sample (RAM (twins) alone)."""
    speed: float | None = None
    """Fastest change of these commands [mm/s]; that of the training, if not given."""
    rate: float = 10.0
    """Rate at which these commands remove the estimated error [1/s]."""
    live: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show it in a viewer (Foxglove, Lichtblick) while it runs; a log is then played at its own pace."""
    live_host: str = "127.0.0.1"
    """Address for viewers; any but this machine's own is open to the network."""
    live_port: int = 8765
    """Port for viewers; 0 for a free one."""
    json: bool = False
    """Print the summary as one JSON object; live, on stderr, as stdout is the stream."""


def run(args: Run) -> Summary:
    """Stream samples through the runtime."""
    from twin.files.bounds import LARGEST_VARIANCE_DEG2, SAMPLE_TIMES, check_between

    if args.sample_time is not None:
        check_between("sample_time", args.sample_time, *SAMPLE_TIMES, "s")
    check_between("noise_variance", args.noise_variance, 1e-9, LARGEST_VARIANCE_DEG2, "deg^2")
    check_between("live_port", args.live_port, 0, 65_535)
    if args.data and args.stroke is not None:
        raise InputError("--stroke: commands are made live alone; a log has had its own")
    return _log(args) if args.data else _stream(args)


def _stream(args: Run) -> Summary:
    """Answer each line of stdin, until they end, the reader of the answers goes or a signal comes."""
    from twin.stream.answers import answers
    from twin.stream.counts import RunCounts

    if args.out is not None:
        output_file(args.out, (".mcap",), "endotwin live", inputs=[args.policy])
    if sys.stdin is None:
        raise InputError("stdin is closed: samples come from there, or name a log")
    runtime, counts = _prepared(args)(), RunCounts()
    commands = _commands(args, runtime)
    facts, not_samples, ended, code = _facts(args, runtime), 0, "the stream has ended", 0
    if sys.stdin.isatty():
        complain("endotwin run: reads samples from the terminal, a JSON line each; Ctrl-D ends it")
    viewer = _viewer(args, runtime)
    recording = live_recording(args.out, runtime.method, facts, controlled=commands is not None)
    with contextlib.closing(Sinks(counts, viewer, recording, on_failure=_say_of_failure)) as sinks:
        try:
            for answer in answers(runtime, sys.stdin.buffer, commands):
                not_samples += answer.sample is None
                if answer.sample is not None:
                    with UninterruptedStep():  # what was answered is recorded, whatever stops this command
                        sinks.add(answer.sample)
                if not stream_line(answer.text):
                    ended = "the reader of the answers has gone"
                    break
        except Stopped as stop:
            ended, code = describe_error(stop), exit_status(stop)
    line = f"{f'{args.out}: ' if args.out else ''}{runtime.method}, {ended}: {counts}"
    if not_samples:
        line += f"; {not_samples} lines that are no samples"
    values = {**facts, "ended": ended, "not_samples": not_samples, **counts.to_dict()}
    return Summary(line, _with_out(args, values), code or int(sinks.failed > 0), to_stderr=True)


def _log(args: Run) -> Summary:
    """Stream each record of a log through a runtime of its own."""
    from twin.export.names import named_files
    from twin.stream.counts import RunCounts
    from twin.stream.log_recording import SIGN
    from twin.stream.log_run import LogRun, log_targets, read_logs, run_log

    files = named_files(args.data)
    targets = log_targets(args.out, list(files))
    if args.out is not None and targets == [args.out]:
        output_file(args.out, (), SIGN, inputs=[args.policy, *files.values()])
    new_runtime, counts = _prepared(args), RunCounts()
    runtime = new_runtime()
    logs = read_logs(files, runtime.sample_time)
    if args.out is not None and targets != [args.out]:
        output_folder(args.out, {target.name: SIGN for target in targets})
    facts, viewer = _facts(args, runtime), _viewer(args, runtime)
    pace = viewer and Pace()
    with contextlib.closing(Sinks(counts, viewer, pace, on_failure=_say_of_failure)) as sinks:
        scores = run_log(
            LogRun(files, logs, targets),
            runtime.method,
            new_runtime,
            sinks,
            facts,
            Progress("run", "sample"),
        )
    line = f"{f'{args.out}: ' if args.out else ''}{runtime.method}, {len(logs)} records: {counts}"
    if scores.rmse_deg is not None:
        line += f"; RMSE {scores.rmse_deg:.3f} deg against the {scores.against}"
    if scores.rmse_steady_deg is not None:
        line += f", {scores.rmse_steady_deg:.3f} deg after the first 5 s"
    values = {**facts, "records": len(logs), **counts.to_dict(), **dataclasses.asdict(scores)}
    return Summary(line, _with_out(args, values))


def _prepared(args: Run) -> "Callable[[], AssuredEstimator]":
    """Return what makes a runtime before its first sample."""
    from twin.runtime import prepare_runtime

    prepared = prepare_runtime(args.policy, sample_time=args.sample_time, noise_variance=args.noise_variance)
    return functools.partial(prepared, args.initial_bend_deg)


def _commands(args: Run, runtime: "AssuredEstimator") -> "LiveCommands | None":
    if args.stroke is None:
        return None
    from twin.control.live import prepare_commands

    return prepare_commands(args.policy, runtime, args.stroke, args.speed, args.rate)


def _viewer(args: Run, runtime: "AssuredEstimator") -> "Sink | None":
    if not args.live:
        return None
    return live_viewer(args.live_host, args.live_port, runtime.method, controlled=args.stroke is not None)


def _facts(args: Run, runtime: "AssuredEstimator") -> dict[str, Any]:
    """Return what made the estimates, for recording and summary."""
    from twin.files.hashes import sha256_of

    return {
        "method": runtime.method,
        "policy": str(args.policy),
        "policy_sha256": sha256_of(args.policy),
        "sample_time_s": runtime.sample_time,
        "noise_variance_deg2": args.noise_variance,
        "initial_bend_deg": args.initial_bend_deg,
    }


def _with_out(args: Run, values: dict[str, Any]) -> dict[str, Any]:
    return {"out": str(args.out), **values} if args.out else values


def _say_of_failure(error: Exception) -> None:
    complain(f"endotwin run: {describe_error(error)}; the stream goes on without it")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Run, run, argv)


if __name__ == "__main__":
    sys.exit(main())
