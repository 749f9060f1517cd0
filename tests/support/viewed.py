"""`endotwin view` in a process of its own, and a request of its page."""

import contextlib
import re
import subprocess
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

from repository import ENVIRONMENT, command


@contextlib.contextmanager
def serving(*words: object, cwd: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The command in a process of its own, at a free port, once it answers."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": ENVIRONMENT}
    with subprocess.Popen(command("view", *words, "--port", 0), cwd=cwd, **options) as process:
        try:
            line = process.stderr.readline()
            (port,) = re.findall(r"open http://127\.0\.0\.1:(\d+) in a browser", line)
            assert process.stderr.readline().startswith(
                f"endotwin view: from another machine, first: ssh -L {port}:127.0.0.1:{port} "
            )
            assert asked(int(port), {})[0] == 200  # waits for the server, as the port listens already
            yield process, int(port)
        finally:
            process.kill()


def asked(port: int, headers: dict[str, str]) -> tuple[int, str]:
    """Status and text of the answer to a request of the page."""
    connection = HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", "/", headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode()
