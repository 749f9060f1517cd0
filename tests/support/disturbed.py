"""Commands that are killed, or whose disk fills up, at a random moment; then the same command runs again."""

import contextlib
import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import snapshot
from built_workbench import Workbench, one_place
from hostile_runs import Ended, Place, Runner, console, job
from snapshot import Snapshot
from verdict import Expected, is_temporary, judge
from workbench import Command

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


@dataclass(frozen=True)
class Undisturbed:
    """Files that a command leaves if nothing disturbs it.

    Attributes:
        contents: hashes of all files of the working folder, by name.
        unstable: names whose contents differ between two such runs.
        wall: seconds that one takes by the clock.
        bytes: that its outputs take on a disk.
    """

    contents: dict[str, str]
    unstable: frozenset[str]
    wall: float
    bytes: int


def undisturbed(command: Command, bench: Workbench, runner: Runner) -> Undisturbed:
    found, walls, sizes = [], [], []
    for _ in range(2):
        with one_place(bench.root) as place:
            before = used(place.around)
            ended = again(command, place, runner)
            assert ended.code == 0, f"endotwin {command.line}\n{ended.err}{ended.stopped}"
            found.append(snapshot.contents(place.work))
            walls.append(ended.wall)
            sizes.append(used(place.around) - before)
    assert found[0].keys() == found[1].keys()
    unstable = {name for name in found[0] if found[0][name] != found[1][name]}
    return Undisturbed(found[0], frozenset(unstable), min(walls), max(sizes))


def again(command: Command, place: Place, runner: Runner, **options: object) -> Ended:
    (ended,) = runner.run(job(shlex.split(command.line), place, **options))
    if ended.hangs and "kill" not in options:
        return console(shlex.split(command.line), place)
    return ended


def faults_of_a_kill(
    command: Command, whole: Undisturbed, seed: int, bench: Workbench, runner: Runner
) -> list[str]:
    """Kill a command, run it again, and compare with the undisturbed run."""
    rng = np.random.default_rng(seed)
    number = SIGNALS[seed % 3]
    kill = {
        "signal": int(number),
        "after": rng.uniform(0, whole.wall),
        "group": bool(number == signal.SIGINT or rng.random() < 0.5),  # a terminal's Ctrl-C reaches all
    }
    with one_place(bench.root) as place:
        before = snapshot.taken(place.around)
        ended = again(command, place, runner, kill=kill)
        faults = of_the_killed(ended, number, command, whole, before, place)
        if number == signal.SIGKILL:  # which leaves no time to tidy up
            shutil.rmtree(place.temporary)
            place.temporary.mkdir()
        faults += of_the_next(again(command, place, runner), whole, place)
    return [f"{number.name} after {kill['after']:.2f} of {whole.wall:.2f} s: {fault}" for fault in faults]


def of_the_killed(
    ended: Ended, number: signal.Signals, command: Command, whole: Undisturbed, before: Snapshot, place: Place
) -> list[str]:
    faults = []
    if "Traceback" in ended.err:
        faults.append(f"traceback: {ended.said[-1][:150]}")
    if ended.code not in (0, 2, 130, 143, -number):
        faults.append(f"exit status {ended.code}: {ended.said[-1:]}")
    if ended.orphans:
        faults.append(f"orphans: {ended.orphans}")
    if ended.stopped:
        faults.append(ended.stopped)
    after = snapshot.taken(place.around)
    for name, how in snapshot.differences(before, after).items():
        short, now = name.removeprefix("work/"), after.get(name)
        done = now is not None and whole.contents.get(short) == (now.content or now.kind)
        kept = snapshot.matches(short, command.kept) or (now is not None and now.kind == "folder")
        # What gets no time to tidy up may leave temporary files: the next run removes them.
        at_once = number == signal.SIGKILL or ended.code == -number
        temporary = at_once and how.startswith("new") and (is_temporary(name) or name.startswith("tmp/"))
        if not (done or kept or temporary or short in whole.unstable):
            faults.append(f"{how} by the killed run: {name}")
    return faults


def of_the_next(ended: Ended, whole: Undisturbed, place: Place) -> list[str]:
    """Faults of the run after one that was disturbed."""
    if ended.code == 2 and not ended.stopped and "Traceback" not in ended.err and len(ended.said) == 1:
        return [] if len(ended.said[0]) <= 300 else ["a line that is too long"]
    if ended.code != 0:
        return [f"run again, it ends with {ended.code}: {ended.stopped} {ended.said[-1:]}"]
    now = snapshot.contents(place.work)
    faults = []
    for name in sorted({*now, *whole.contents} - whole.unstable):
        if now.get(name) != whole.contents.get(name):
            how = "left over" if name not in whole.contents else "missing" if name not in now else "another"
            faults.append(f"run again, {name} is {how}")
    return faults


def used(folder: Path) -> int:
    """Bytes that the files below a folder take on a disk of blocks of 4 KiB."""
    sizes = [path.lstat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return sum(-(-size // 4096) * 4096 for size in sizes)


@contextlib.contextmanager
def small_disk(place: Place, free: int) -> Iterator[None]:
    """Context manager: the surroundings of a run on a disk with so many bytes free."""
    aside = place.root / "aside"
    place.around.rename(aside)
    place.around.mkdir()
    size = used(aside) + free + 65536
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place.around)]
    mounted = subprocess.run(command, capture_output=True, text=True)
    if mounted.returncode:
        pytest.skip(f"cannot mount a file system here: {mounted.stderr.strip()}")
    try:
        shutil.copytree(aside, place.around, symlinks=True, dirs_exist_ok=True)
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(place.around)], check=True)


def enlarge(place: Place) -> None:
    options = f"remount,size={2**30}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place.around)], check=True)


def faults_of_a_full_disk(
    command: Command, whole: Undisturbed, seed: int, bench: Workbench, runner: Runner
) -> list[str]:
    """Run a command on a disk that is too small, then with enough space, and compare."""
    free = int(np.random.default_rng(seed).uniform(0, max(whole.bytes, 4096)))
    with one_place(bench.root) as place, small_disk(place, free):
        before = snapshot.taken(place.around)
        ended = again(command, place, runner)
        after = snapshot.taken(place.around)
        faults = []
        if ended.code != 0:
            trace = bench.traces[command.name]
            expected = Expected(command, frozenset(trace.reads), frozenset(trace.outputs))
            finished = {
                name: found
                for name, found in after.items()
                if whole.contents.get(name.removeprefix("work/")) == (found.content or found.kind)
            }
            faults = judge(
                ended, expected, place, before, after | {k: before.get(k, v) for k, v in finished.items()}
            ).faults
            faults = [fault for fault in faults if not any(fault.endswith(f": {name}") for name in finished)]
        enlarge(place)
        faults += of_the_next(again(command, place, runner), whole, place)
    return [f"{free} of {whole.bytes} bytes free: {fault}" for fault in faults]


def processes_of(words: list[str], place: Place, count: int) -> list[dict]:
    """Jobs of the same command, each with a log of its own."""
    return [
        job(words, place, stdout=str(place.logs / f"{k}.out"), stderr=str(place.logs / f"{k}.err"))
        for k in range(count)
    ]


def repeat_count(default: int) -> range:
    """Seeds; the one of the environment alone, where it names one."""
    only = os.environ.get("HOSTILE_SEED")
    return range(int(only), int(only) + 1) if only else range(default)
