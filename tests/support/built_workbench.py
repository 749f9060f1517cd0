"""The workbench as it is built: once for all tests, with what each command reads and writes there."""

import fcntl
import json
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import snapshot
from hostile_files import kind_of
from hostile_runs import Place, Runner, console, job
from traced_files import attempted, watched
from workbench import BUILT, COMMANDS, Command, write_inputs

PATIENT = {"limit": 300, "most_cpu": 60, "idle": 20}
"""For a good run, however busy the machine."""
HALF_DONE = (
    ("train again", "stopped/checkpoint.state"),
    ("calibrate again", ".taken*calibration*"),
)
"""Commands that go on from what a killed run has left, and the file whose appearance says when to kill it."""


@dataclass(frozen=True)
class Trace:
    """One good run of a command.

    Attributes:
        reads: files of the workbench that it opens.
        lacks: names that it tries to open and that are not there.
        outputs: files and folders that it writes.
        kinds: formats of the files that it reads.
        cpu: seconds of the processor.
        wall: seconds by the clock.
    """

    reads: tuple[str, ...]
    lacks: tuple[str, ...]
    outputs: tuple[str, ...]
    kinds: dict[str, str]
    cpu: float
    wall: float


@dataclass(frozen=True)
class Workbench:
    """A folder to copy for each run, and the traces of all commands by name."""

    root: Path
    traces: dict[str, Trace]


def shared(folder: Path, runner: Runner) -> Workbench:
    """Build it in a folder, or take what another process of these tests has built there."""
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        root, told = folder / "bench", folder / "traces.json"
        if not told.exists():
            shutil.rmtree(root, ignore_errors=True)
            build(root, runner)
            found = runner.each(lambda command: traced(command, root, runner), [*COMMANDS])
            traces = {command.name: asdict(trace) for command, trace in zip(COMMANDS, found, strict=True)}
            told.write_text(json.dumps(traces, indent=1))
    loaded = json.loads(told.read_text())
    return Workbench(root, {name: Trace(**values) for name, values in loaded.items()})


def build(root: Path, runner: Runner) -> None:
    place = Place(root)
    outside = place.around / "outside"
    for folder in (place.work, place.temporary, place.logs, outside / "folder"):
        folder.mkdir(parents=True)
    (outside / "precious.txt").write_text("worth a year\n")
    (outside / "folder" / "kept.txt").write_text("worth another\n")
    write_inputs(place.work)
    for line in BUILT:
        (ended,) = runner.run(job(line.split(), place, **PATIENT))
        if ended.hangs:  # a fork of a process with threads may find a lock held for ever
            ended = console(line.split(), place)
        assert ended.code == 0, f"endotwin {line}\n{ended.err}\n{ended.stopped}\n{ended.stack}"
    lines = {command.name: command.line for command in COMMANDS}
    for name, appears in HALF_DONE:
        kill = {"signal": signal.SIGKILL, "after": 0, "when": appears, "group": True}
        runner.run(job(lines[name].split(), place, kill=kill))


def traced(command: Command, root: Path, runner: Runner) -> Trace:
    """Run a command on good input and watch it."""
    with one_place(root) as place:
        before = snapshot.taken(place.work)
        log = place.logs / "opened"
        with watched(place.work) as opened:
            options = {"trace": str(log), "no_children": command.fails} | PATIENT
            (ended,) = runner.run(job(command.line.split(), place, **options))
            if ended.hangs:
                ended = console(command.line.split(), place, no_children=command.fails)
        assert ended.code == 0 or command.fails, (
            f"endotwin {command.line}\n{ended.err}\n{ended.stopped}\n{ended.stack}"
        )
        seen = opened | attempted(log, place.work)
        reads = sorted(name for name in seen if before.get(name, ("",))[0] == "file")
        outputs = snapshot.differences(before, snapshot.taken(place.work))
        return Trace(
            reads=tuple(reads),
            lacks=tuple(sorted(name for name in seen if name not in before and name not in outputs)),
            outputs=tuple(outputs),
            kinds={name: kind_of(root / "around" / "work" / name) for name in reads},
            cpu=ended.cpu,
            wall=ended.wall,
        )


@contextmanager
def one_place(root: Path) -> Iterator[Place]:
    """Context manager: a copy of the workbench for one run, in memory where there is such a file system."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None, prefix="endotwin-") as folder:
        shutil.copytree(root / "around", Path(folder) / "around", symlinks=True)
        place = Place(Path(folder))
        place.logs.mkdir()
        try:
            yield place
        finally:
            open_all(place.root)


def open_all(folder: Path) -> None:
    """Make it possible to remove what a run has made unreadable."""
    for above, names, _ in os.walk(folder):
        for name in names:
            path = Path(above, name)
            if not path.is_symlink():
                path.chmod(0o755)
