"""Commands that are killed, or whose disk fills up, at a random moment; then the same command runs again."""

import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
from hostile_cases import changes, snapshot
from repository import ENVIRONMENT, command
from workspace import COMMANDS, copied, matches

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


def run(name: str, work: Path, kill: tuple[signal.Signals, float] | None = None) -> tuple[int, str]:
    """Run a command in a process of its own, killed after some seconds; exit code and stderr."""
    words = command(*shlex.split(COMMANDS[name].line))
    environment = ENVIRONMENT | {"TMPDIR": str(work)}
    process = subprocess.Popen(
        words, cwd=work, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    if kill:
        try:
            process.wait(kill[1])
        except subprocess.TimeoutExpired:
            process.send_signal(kill[0])
    _, said = process.communicate(timeout=300)
    return process.returncode, said


class Undisturbed:
    """Files that a command leaves if nothing disturbs it.

    Attributes:
        files: content by name, see `hostile_cases.snapshot`.
        unstable: names whose contents differ between two such runs.
        seconds: that one takes.
    """

    def __init__(self, name: str, root: Path, tmp: Path) -> None:
        found = []
        for number in range(2):
            with copied(root, tmp / f"undisturbed {number}") as work:
                begin = time.monotonic()
                code, said = run(name, work)
                assert code == 0, said
                self.seconds = time.monotonic() - begin
                found.append(snapshot(work))
        self.files = found[0]
        self.unstable = changes(*found).keys()

    def faults(self, code: int, said: str, work: Path) -> list[str]:
        """Faults of the run that follows a disturbed one."""
        if code != 0:
            refused = code == 2 and "Traceback" not in said and len(said.splitlines()) == 1
            return [] if refused else [f"run again, it ends with {code}: {said[-200:]}"]
        differ = changes(self.files, snapshot(work))
        return [f"run again, {name} is {how}" for name, how in differ.items() if name not in self.unstable]


def faults_of_a_kill(name: str, whole: Undisturbed, seed: int, root: Path, tmp: Path) -> list[str]:
    """Kill a command, run it again, and compare with the undisturbed run."""
    number, after = SIGNALS[seed % 3], float(np.random.default_rng(seed).uniform(0.3, 1) * whole.seconds)
    with copied(root, tmp / "killed") as work:
        before = snapshot(work)
        code, said = run(name, work, kill=(number, after))
        faults = [] if code in (0, 2, 128 + number, -number) else [f"exit code {code}"]
        faults += ["a traceback"] if "Traceback" in said and code != -number else []
        for path, how in changes(before, snapshot(work)).items():
            done = snapshot(work).get(path) == whole.files.get(path) or path in whole.unstable
            kept = matches(path, COMMANDS[name].kept) or (work / path).is_dir()
            temporary = number == signal.SIGKILL or code == -number  # no time to clean up
            if not (done or kept or (temporary and how == "new")):
                faults.append(f"{how} by the killed run: {path}")
        faults += whole.faults(*run(name, work), work)
    return [f"{name}, {number.name} after {after:.2f} of {whole.seconds:.2f} s: {fault}" for fault in faults]


def faults_of_a_full_disk(name: str, whole: Undisturbed, seed: int, root: Path, small_disk) -> list[str]:
    """Run a command on a disk that is too small, then with enough space, and compare."""
    needed = sum(path.stat().st_size for path in root.rglob("*") if path.is_file()) // 1024
    free = int(np.random.default_rng(seed).uniform(8, 200))
    disk = small_disk(2 * needed + 4096)
    work = disk / "work"
    shutil.copytree(root, work)
    used = shutil.disk_usage(disk).used // 1024
    small_disk(used + free)
    before = snapshot(work)
    code, said = run(name, work)
    faults = [] if code in (0, 2) and "Traceback" not in said else [f"exit code {code}: {said[-200:]}"]
    if code == 2:
        lost = [path for path, how in changes(before, snapshot(work)).items() if how != "new"]
        faults += [f"{path} is damaged" for path in lost]
    small_disk(2 * needed + 65536)
    faults += whole.faults(*run(name, work), work)
    shutil.rmtree(work)
    return [f"{name}, {free} KiB free: {fault}" for fault in faults]
