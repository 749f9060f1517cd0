"""Runs of `endotwin` by the hundred: forked from a warm process, or by the real command as a control."""

import contextlib
import json
import os
import queue
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from repository import REPOSITORY

SUPPORT = Path(__file__).parent
LIMIT_SECONDS = 120.0
"""When a run is stopped by the clock: a busy machine is no fault of it."""
IDLE_SECONDS = 10
"""A run that sleeps so long, without a child at work, waits for something that never comes."""
MOST_CPU_SECONDS = 15.0
"""When it is stopped by what it has used of the processor."""
NO_THREADS = {"JE_ARROW_MALLOC_CONF": "background_thread:false", "ARROW_DEFAULT_MEMORY_POOL": "system"}
"""Arrow's allocator has a thread of its own: a fork may find a lock that it held, and wait for ever."""


@dataclass(frozen=True)
class Ended:
    """How a run ended.

    Attributes:
        code: exit status; negative if a signal ended it.
        out: what it printed.
        err: what it printed on stderr, bars of progress included.
        wall: seconds by the clock.
        cpu: seconds of the processor.
        bytes: most memory that it held.
        stopped: why it was stopped from outside; empty if it was not.
        orphans: command lines of processes that it left.
        stack: where it stood when it was stopped.
    """

    code: int
    out: str
    err: str
    wall: float = 0.0
    cpu: float = 0.0
    bytes: int = 0
    stopped: str = ""
    orphans: list[str] = field(default_factory=list)
    stack: str = ""

    @property
    def hangs(self) -> bool:
        """True if it slept for ever: a fork of a process with threads may find a lock that nobody releases.

        A fresh process says whether the command itself does.
        """
        return self.stopped.startswith("waited")

    @property
    def said(self) -> list[str]:
        """Lines on stderr that are no bar of progress."""
        lines = re.split(r"[\r\n]+", self.err)
        return [line for line in lines if line.strip() and not BAR.search(line)]


BAR = re.compile(r"\d+%\|.*\[|\[[\d:?]+(<[\d:?]+)?, .*/s|it/s\b")
"""A bar of progress as tqdm draws it."""


class Server:
    """The other end of `hostile_server.py`."""

    def __init__(self) -> None:
        path = os.pathsep.join(map(str, (REPOSITORY, SUPPORT)))
        threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
        self.process = subprocess.Popen(
            [sys.executable, str(SUPPORT / "hostile_server.py")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | threads | NO_THREADS | {"PYTHONPATH": path},
            text=True,
        )

    def run(self, *jobs: dict[str, Any]) -> list[Ended]:
        """Run jobs side by side and wait for all."""
        self.process.stdin.write(json.dumps(jobs) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, "the server of runs has ended"
        return [ended(job, answer) for job, answer in zip(jobs, json.loads(line), strict=True)]

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait(30)


def ended(job: dict[str, Any], answer: dict[str, Any]) -> Ended:
    out, err, stack = (
        text_of(job[name] + end) for name, end in (("stdout", ""), ("stderr", ""), ("stderr", ".stack"))
    )
    return Ended(out=out, err=err, stack=stack, **answer)


def text_of(path: str) -> str:
    with open(path, "rb") as file:
        return file.read(2_000_000).decode(errors="replace")


def job(words: list[str], place: "Place", **options: Any) -> dict[str, Any]:
    """A run of `endotwin WORDS` in a folder."""
    return {
        "words": words,
        "cwd": str(place.work),
        "stdout": str(place.logs / "stdout"),
        "stderr": str(place.logs / "stderr"),
        "environment": {"TMPDIR": str(place.temporary), "PYTHONPATH": str(REPOSITORY)},
        "limit": LIMIT_SECONDS,
        "most_cpu": MOST_CPU_SECONDS,
        "idle": IDLE_SECONDS,
        "threads": True,
    } | options


@dataclass(frozen=True)
class Place:
    """The surroundings of one run: where it works, what is beside that, and where its output is kept.

    Attributes:
        root: folder that nothing but this run uses.
    """

    root: Path

    @property
    def work(self) -> Path:
        return self.root / "around" / "work"

    @property
    def around(self) -> Path:
        """What no run may change but for its outputs in `work`."""
        return self.root / "around"

    @property
    def precious(self) -> Path:
        """A file that is no business of any run."""
        return self.root / "around" / "outside" / "precious.txt"

    @property
    def temporary(self) -> Path:
        return self.root / "around" / "tmp"

    @property
    def canary(self) -> Path:
        """What a pickle makes when it is loaded."""
        return self.root / "canary"

    @property
    def logs(self) -> Path:
        return self.root / "logs"


def console(words: list[str], place: Place, no_children: bool = False) -> Ended:
    """The same by the real command, in a fresh process."""
    environment = os.environ | {
        "PYTHONPATH": str(REPOSITORY),
        "OMP_NUM_THREADS": "1",
        "TMPDIR": str(place.temporary),
    }
    command = [sys.executable, "-m", "twin", *words]
    if no_children:
        command[1:3] = [
            "-c",
            "import sys; sys.executable = '/bin/false'; from twin.__main__ import main; sys.exit(main())",
        ]
    with subprocess.Popen(
        command,
        cwd=place.work,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        try:
            out, err = process.communicate(timeout=LIMIT_SECONDS)
            stopped = ""
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            stopped = f"had not ended after {LIMIT_SECONDS:.0f} s"
    return Ended(
        process.returncode, out.decode(errors="replace"), err.decode(errors="replace"), stopped=stopped
    )


class Runner:
    """Servers, and as many threads that give them work."""

    def __init__(self, servers: int) -> None:
        self._servers: queue.Queue[Server] = queue.Queue()
        self.count = servers
        for _ in range(servers):
            self._servers.put(Server())

    def __enter__(self) -> "Runner":
        return self

    def __exit__(self, *_: Any) -> None:
        for _ in range(self.count):
            self._servers.get().close()

    @contextlib.contextmanager
    def server(self) -> Iterator[Server]:
        server = self._servers.get()
        try:
            yield server
        finally:
            self._servers.put(server)

    def run(self, *jobs: dict[str, Any]) -> list[Ended]:
        with self.server() as server:
            return server.run(*jobs)

    def each(self, function: Any, items: list[Any]) -> list[Any]:
        """Call a function of each item, as many at a time as there are servers."""
        with ThreadPoolExecutor(self.count) as threads:
            return list(threads.map(function, items))
