"""The repository under test, and its command in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
"""Of a process that imports what is under test, wherever it runs."""


def command(*words: object) -> list[str]:
    """`endotwin WORDS` as a process is given it."""
    return [sys.executable, "-m", "scripts", *map(str, words)]


def endotwin(
    *words: object, cwd: Path, timeout: float = 300, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own, in a folder."""
    return subprocess.run(
        command(*words), cwd=cwd, capture_output=True, text=True, env=ENVIRONMENT, timeout=timeout, **options
    )
