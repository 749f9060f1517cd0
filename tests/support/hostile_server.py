"""A process that has imported everything once and forks for each run of `endotwin`: no run waits for imports.

It reads one JSON list of jobs per line from its standard input, runs them side by side, and answers with one
JSON list of how they ended. `hostile_runs.py` is its other end.
"""

import atexit
import contextlib
import faulthandler
import functools
import importlib
import io
import json
import logging
import os
import pkgutil
import signal
import sys
import tempfile
import threading
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import psutil

LAZY = (
    "onnxruntime",
    "mujoco.renderer",
    "yaml",
    "tyro",
    "pyarrow.parquet",
    "av",
    "PIL.PngImagePlugin",
)
"""Modules that the packages import only when they are used."""
MOST_BYTES = 3 * 2**30
"""Of a run: one that takes more is killed, or it would take the machine with it."""
GRACE_SECONDS = 5
"""Within which what a run has started ends after it."""


def import_everything() -> None:
    for package in ("twin", "rl", "scripts"):
        folder = importlib.import_module(package).__path__
        for module in pkgutil.walk_packages(folder, f"{package}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
    for name in LAZY:
        importlib.import_module(name)
    export_once()


def export_once() -> None:
    """Export a network of one unit: half a thousand modules are imported by the first export alone."""
    import torch
    from torch.onnx._internal.exporter._registration import ONNXRegistry

    network = torch.nn.Linear(1, 1)
    torch.optim.Adam(network.parameters())
    ONNXRegistry.from_torchlib = staticmethod(
        functools.cache(ONNXRegistry.from_torchlib)
    )  # for each run a copy of its own
    logging.disable(logging.WARNING)
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings(action="ignore"):
        torch.onnx.export(network, (torch.zeros(1, 1),), dynamo=True)
    logging.disable(logging.NOTSET)


def main() -> None:
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w")
    quiet = os.open(os.devnull, os.O_RDWR)
    os.dup2(quiet, 0)
    os.dup2(2, 1)  # what a library prints while it is imported is no answer
    import_everything()
    for line in requests:
        begun = []
        for job in json.loads(line):
            pid = os.fork()
            if pid == 0:
                requests.close()
                answers.close()
                become(job)
            begun.append(Watched(pid, job))
        while any([not watched.look() for watched in begun]):
            time.sleep(0.004)
        answers.write(json.dumps([watched.answer for watched in begun]) + "\n")
        answers.flush()
    os._exit(0)  # the interpreter would take seconds to tear everything down


class Watched:
    """A run that is watched from outside: its time, memory, and whatever it leaves behind."""

    def __init__(self, pid: int, job: dict[str, Any]) -> None:
        self.pid, self.job = pid, job
        self.begin = time.monotonic()
        self.answer: dict[str, Any] = {}
        self.stopped = ""
        self.kill = job.get("kill")
        self.looks = 0
        self.awake = self.spent = 0.0

    def look(self) -> bool:
        """Whether it has ended; kill what takes too much, or what is to be killed now."""
        if self.answer:
            return True
        pid, status, used = os.wait4(self.pid, os.WNOHANG)
        wall = time.monotonic() - self.begin
        if pid:
            self.answer = {
                "code": os.waitstatus_to_exitcode(status),
                "wall": wall,
                "cpu": used.ru_utime + used.ru_stime,
                "bytes": used.ru_maxrss * 1024,
                "stopped": self.stopped,
                "orphans": self.orphans(),
            }
            return True
        if self.kill and self.is_time(wall):
            self.send(self.kill["signal"], group=self.kill["group"])
            self.kill = None
        self.looks += 1
        if self.looks % 25 == 0 and not self.stopped:
            self.watch(wall)
        return False

    def is_time(self, wall: float) -> bool:
        """Whether the run is to be killed now: after a time, or when there is a file."""
        if not Path(self.job["stdout"]).exists():  # until then it is still this process
            return False
        pattern = self.kill.get("when")
        return wall >= self.kill["after"] and (not pattern or any(Path(self.job["cwd"]).glob(pattern)))

    def watch(self, wall: float) -> None:
        """Stop what takes too much time or memory, or sleeps and waits for nothing."""
        try:
            process = psutil.Process(self.pid)
            spent, held = sum(process.cpu_times()[:4]), process.memory_info().rss
            asleep = sleeps(self.pid) and not process.children()
        except (psutil.NoSuchProcess, FileNotFoundError):
            return
        if not asleep or spent > self.spent + 0.02:
            self.awake, self.spent = wall, spent
        if held > MOST_BYTES:
            self.stopped = f"took {held / 2**30:.1f} GiB"
        elif wall - self.awake > self.job["idle"]:
            self.stopped = f"waited for {self.job['idle']} s for nothing"
        elif wall > self.job["limit"] or spent > self.job["most_cpu"]:
            self.stopped = f"had not ended after {wall:.0f} s ({spent:.1f} s of the processor)"
        if self.stopped:
            self.send(signal.SIGUSR1)  # writes where it is
            time.sleep(0.3)
            self.send(signal.SIGKILL, group=True)

    def send(self, number: int, group: bool = False) -> None:
        with contextlib.suppress(ProcessLookupError):
            (os.killpg if group else os.kill)(self.pid, number)

    def orphans(self) -> list[str]:
        """Command lines of what it has started and not ended."""
        end = time.monotonic() + GRACE_SECONDS
        while True:
            left = {pid: words for pid, words in running() if session(pid) == self.pid}
            if not left or time.monotonic() > end:
                break
            time.sleep(0.05)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        return list(left.values())


def sleeps(pid: int) -> bool:
    """Whether each thread of a process waits, and none of them for a disk."""
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):  # it has ended meanwhile
            if (task / "stat").read_text().rpartition(")")[2].split()[0] != "S":
                return False
    return True


def running() -> list[tuple[int, str]]:
    found = []
    for process in psutil.process_iter(["pid", "status", "cmdline"]):
        if process.info["status"] != psutil.STATUS_ZOMBIE:
            found.append((process.info["pid"], " ".join(process.info["cmdline"] or [])[:200]))
    return found


def session(pid: int) -> int:
    try:
        return os.getsid(pid)
    except (ProcessLookupError, PermissionError):
        return -1


def become(job: dict[str, Any]) -> None:
    """Turn this fork into the run."""
    os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM):  # until the command line sees to them
        signal.signal(number, signal.SIG_DFL)
    for descriptor, name in ((1, job["stdout"]), (2, job["stderr"])):
        file = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        os.dup2(file, descriptor)
        os.close(file)
    faulthandler.register(signal.SIGUSR1, open(job["stderr"] + ".stack", "w"))  # noqa: SIM115
    os.environ |= job["environment"]
    tempfile.tempdir = None  # named anew from the environment
    os.chdir(job["cwd"])
    if job.get("trace"):
        importlib.import_module("traced_files").log_opened(Path(job["trace"]))
    if job.get("threads"):
        threads_for_processes()
        draw_coarsely()
    if job.get("no_children"):
        sys.executable = "/bin/false"
    if "call" in job:
        module, name = job["call"].split(":")
        leave(functools.partial(getattr(importlib.import_module(module), name), *job["arguments"]))
    sys.argv = ["endotwin", *job["words"]]
    leave(importlib.import_module("twin.__main__").main)


def threads_for_processes() -> None:
    """Episodes are made in this process: a worker of its own would import everything again."""
    from concurrent.futures import ThreadPoolExecutor

    for name in ("twin.workers.processes", "rl.suite.full"):
        importlib.import_module(name).local_workers = lambda count, begin=None: ThreadPoolExecutor(1)


def draw_coarsely() -> None:
    """Figures of few pixels, which are drawn soon; the films are small by their own option."""
    from matplotlib.figure import Figure

    drawn = Figure.savefig
    Figure.savefig = lambda self, *args, **options: drawn(self, *args, **options | {"dpi": 20})


def leave(function: Any) -> None:
    """Call a function and end as the interpreter would, but for tearing down its modules."""
    try:
        code = function() or 0
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    if not isinstance(code, int):
        print(code, file=sys.stderr)
        code = 1
    try:
        threading._shutdown()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        traceback.print_exc()
        code = 120
    os._exit(code & 255)


if __name__ == "__main__":
    main()
