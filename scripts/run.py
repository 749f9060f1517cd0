"""`endotwin run`: a trained estimator on a log or on a live stream, sample by sample."""

import contextlib
import dataclasses
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

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
from twin.errors import InputError

if TYPE_CHECKING:
    from twin.estimation.learned.trained_file import TrainedFile
    from twin.live import AssuredEstimator, Sink, StreamSample


@dataclasses.dataclass(frozen=True)
class Run:
    """Run a trained estimator sample by sample: on a log, or live on JSON lines from stdin to stdout.

    Live, each line in is a sample, {"time_s": 0.1, "pull_mm": 0.2, "measurement_deg": 1.3}. It is answered by
    one line with the estimate, its 95 % interval, its source, and health; see docs/deployment.md.

    Examples:
        endotwin run --policy runs/device/policy.onnx data/measured --out run.mcap
        endotwin run --policy runs/device/policy.onnx --out live.mcap < bench.jsonl > readings.jsonl
    """

    GROUPS: ClassVar = {
        "Sensor": "sample_time",
        "Start": "start",
        "Commands in closed loop": "stroke",
        "Viewer": "live",
    }

    data: tyro.conf.Positional[tuple[Path, ...]] = ()
    """A log: folders of MCAP files, or files. Without it, live."""
    policy: Path = dataclasses.field(kw_only=True)
    """Trained file of any method, as `endotwin train` writes it."""
    out: Path | None = None
    """Recording of the run: NAME.mcap, with the records of a log one after another; or, for a log, a folder
    with a file for each record."""
    sample_time: float | None = None
    """T [s]; if not given, that of the sensor if the trained file states one, else that of the training. A
    log is thinned to about T."""
    noise_variance: float | None = None
    """R of the sensor [deg^2]; if not given, estimated from a log, and live as in the trained file."""
    sensor_zero_deg: float | None = None
    """Reading of the sensor when the section is straight [deg]; that of the trained file, if not given."""
    sensor_zero_deviation_deg: float | None = None
    """Standard deviation of that zero [deg], 0 if it is calibrated; that of the trained file, if not
    given."""
    sensor_lag_s: float | None = None
    """Age of a reading when it arrives [s]; that of the trained file, if not given."""
    preset: str | None = None
    """Endoscope whose twins check the sensor: name of a preset, or a YAML file with ranges. Not needed by an
    estimator that was trained on twins."""
    start: Literal["unknown", "rest"] = "unknown"
    """State before the first sample; rest: the endoscope was straight and has not moved."""
    initial_bend_deg: float = 0.0
    """Estimate at the first sample [deg]."""
    initial_deviation_deg: float = math.inf
    """Standard deviation of that estimate [deg], for RAM (twins)."""
    stroke: tuple[float, float] | None = None
    """Lowest and highest pull that may be commanded [mm]. Answers to lines with "reference_deg" then contain
    "command_mm", the pull to command at the next sample (live, with RAM (twins))."""
    speed: float | None = None
    """Fastest change of these commands [mm/s]; that of the training, if not given."""
    rate: float = 10.0
    """Rate at which these commands remove the estimated error [1/s]."""
    live: bool = False
    """Show the run in a viewer (Foxglove, Lichtblick); a log is then played at its own pace."""
    live_host: str = "127.0.0.1"
    """Address for viewers; any but this machine's own is open to the network."""
    live_port: int = 8765
    """Port for viewers; 0 for a free one."""
    live_origin: tuple[str, ...] = ()
    """More web pages that may watch, such as https://lab.example; allowed are this machine, Foxglove and
    Lichtblick."""
    json: bool = False
    """Print the summary as one JSON object; live, on stderr."""


class Sinks:
    """Several sinks as one; one that fails is left out from then on, and the stream goes on."""

    def __init__(self, *sinks: "Sink | None"):
        self._sinks = [sink for sink in sinks if sink is not None]
        self.failed = 0  # number of those that failed

    def add(self, sample: "StreamSample") -> None:
        """Pass a sample to each."""
        for sink in [*self._sinks]:
            try:
                sink.add(sample)
            except OSError as error:
                self._sinks.remove(sink)
                self._fail(error)
                with contextlib.suppress(OSError, ValueError):
                    sink.close()

    def close(self) -> None:
        """Close each."""
        while self._sinks:
            try:
                self._sinks[-1].close()  # a signal may come first: it is closed again
                self._sinks.pop()
            except (OSError, ValueError) as error:
                self._sinks.pop()
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.failed += 1
        complain(f"endotwin run: {describe_error(error)}; the stream goes on without it")


class Pace:
    """Sink that waits, so that a log takes as long as it took when it was recorded."""

    def __init__(self) -> None:
        self._offset_s: float | None = None

    def add(self, sample: "StreamSample") -> None:
        """Wait until the time of a sample."""
        now = time.monotonic()
        if self._offset_s is None:
            self._offset_s = now - sample.time_s
        time.sleep(max(sample.time_s + self._offset_s - now, 0.0))

    def close(self) -> None:
        """Do nothing."""


def run(args: Run) -> Summary:
    """Stream samples through the runtime."""
    from twin.files.bounds import LARGEST_VARIANCE_DEG2, SAMPLE_TIMES, check_between

    if args.sample_time is not None:
        check_between("sample_time", args.sample_time, *SAMPLE_TIMES, "s")
    if args.noise_variance is not None:
        check_between("noise_variance", args.noise_variance, 1e-9, LARGEST_VARIANCE_DEG2, "deg^2")
    check_between("live_port", args.live_port, 0, 65_535)
    if args.data and args.stroke is not None:
        raise InputError("--stroke: commands are made live alone; a log has had its own")
    return _log(args) if args.data else _stream(args)


def _stream(args: Run) -> Summary:
    """Answer each line of stdin, until they end, the reader of the answers goes or a signal comes."""
    from twin.estimation.learned.trained_file import read_trained_file
    from twin.live.lines import answers
    from twin.live.reading import RunCounts

    if args.out is not None:
        output_file(args.out, (".mcap",), "endotwin live", inputs=[args.policy])
    if sys.stdin is None:
        raise InputError("stdin is closed: samples come from there, or name a log")
    runtime, counts, commands = _prepared(args, read_trained_file(args.policy))(), RunCounts(), None
    if args.stroke is not None:
        from twin.control.compensator import prepare_commands

        commands = prepare_commands(args.policy, runtime, args.stroke, args.speed, args.rate)
    facts, not_samples, ended, code = _facts(args, runtime), 0, "the stream has ended", 0
    if sys.stdin.isatty():
        complain("endotwin run: reads samples from the terminal, a JSON line each; Ctrl-D ends it")
    viewer, recording = _viewer(args, runtime), None
    if args.out is not None:
        from twin.recording.live import LiveRecording

        recording = LiveRecording(
            args.out, runtime.method, {"run": facts}, controlled=commands is not None
        ).__enter__()
    with contextlib.closing(Sinks(counts, viewer, recording)) as sinks:
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
    values = _out(args) | {**facts, "ended": ended, "not_samples": not_samples, **counts.to_dict()}
    return Summary(line, values, code or int(sinks.failed > 0), to_stderr=True)


def _log(args: Run) -> Summary:
    from twin.estimation.learned.trained_file import read_trained_file
    from twin.export.export import named_files
    from twin.live.log_run import SIGN, log_targets, noise_of, read_logs, run_log
    from twin.live.reading import RunCounts

    files = named_files(args.data)
    targets = log_targets(args.out, list(files))
    if args.out is not None and targets == [args.out]:
        output_file(args.out, (), SIGN, inputs=[args.policy, *files.values()])
    file = read_trained_file(args.policy)
    logs = read_logs(files, _prepared(args, file)().sample_time)
    if args.noise_variance is None:
        args = dataclasses.replace(args, noise_variance=noise_of(logs))
    new_runtime, counts = _prepared(args, file), RunCounts()
    runtime = new_runtime()
    if args.out is not None and targets != [args.out]:
        output_folder(args.out, {target.name: SIGN for target in targets})
    facts, viewer = _facts(args, runtime), _viewer(args, runtime)
    with contextlib.closing(Sinks(counts, viewer, viewer and Pace())) as sinks:
        progress = Progress("run", "sample")
        scores = run_log(files, logs, targets, runtime.method, new_runtime, sinks, facts, progress)
    line = f"{f'{args.out}: ' if args.out else ''}{runtime.method}, {len(logs)} records: {counts}"
    if scores.rmse_deg is not None:
        line += f"; RMSE {scores.rmse_deg:.3f} deg against the {scores.against}"
    if scores.rmse_steady_deg is not None:
        line += f", {scores.rmse_steady_deg:.3f} deg after the first 5 s"
    values = _out(args) | {**facts, "records": len(logs), **counts.to_dict(), **dataclasses.asdict(scores)}
    return Summary(line, values)


def _prepared(args: Run, file: "TrainedFile") -> "Callable[[], AssuredEstimator]":
    from twin.estimation.deployment import sensor_of
    from twin.live import prepare_runtime
    from twin.preset import load_preset, load_ranges

    prepared = prepare_runtime(
        file,
        sample_time=args.sample_time,
        noise_variance=args.noise_variance,
        sensor=sensor_of(file).replace(
            zero_deg=args.sensor_zero_deg,
            zero_deviation_deg=args.sensor_zero_deviation_deg,
            lag_s=args.sensor_lag_s,
        ),
        start=args.start,
        initial_deviation_deg=args.initial_deviation_deg,
        twins=(load_preset(args.preset), load_ranges(args.preset)) if args.preset else None,
    )
    return partial(prepared, args.initial_bend_deg)


def _viewer(args: Run, runtime: "AssuredEstimator") -> "Sink | None":
    if not args.live:
        return None
    from scripts.live import LiveViewer

    viewer = LiveViewer(
        args.live_host,
        args.live_port,
        runtime.method,
        controlled=args.stroke is not None,
        origins=args.live_origin,
    )
    complain(f"endotwin run: open {viewer.url} in Foxglove or Lichtblick")
    return viewer


def _out(args: Run) -> dict[str, Any]:
    return {"out": str(args.out)} if args.out else {}


def _facts(args: Run, runtime: "AssuredEstimator") -> dict[str, Any]:
    from twin.files.bounded import sha256_of

    return {
        "method": runtime.method,
        "policy": str(args.policy),
        "policy_sha256": sha256_of(args.policy),
        "sample_time_s": runtime.sample_time,
        "noise_variance_deg2": runtime.noise_variance,
        "sensor": runtime.sensor.to_dict(),
        "initial_bend_deg": args.initial_bend_deg,
        "start": args.start,
    }


main = partial(run_verb, Run, run)

if __name__ == "__main__":
    sys.exit(main())
