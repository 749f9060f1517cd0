"""What is made once for all processes of a run of the tests."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], Any]) -> tuple[Path, Any]:
    """A folder that `make` fills and what it returns (as JSON), from whichever process comes first.

    ENDOTWIN_TESTS_MADE names a folder that keeps it from one run to the next.
    """
    base = factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    base = Path(os.environ.get("ENDOTWIN_TESTS_MADE", base))
    folder, answer = base / name, base / f"{name}.made"
    with FileLock(base / f"{name}.lock"):
        if not answer.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            answer.write_text(json.dumps(make(folder)))
    return folder, json.loads(answer.read_text())
