"""`endotwin VERB` and `python -m twin VERB`: runs the command line, one file per verb in `scripts/`.

In a checkout that folder is next to `twin`, in a wheel inside it, so that no package called `scripts` is
installed. Here it gets the name that its files import one another by.
"""

import importlib.util
import os
import signal
import sys
from pathlib import Path
from types import FrameType


def main() -> int:
    """Run the verb that the command line names; returns the exit code."""
    signal.signal(signal.SIGINT, _stop_at_once)
    inside = Path(__file__).resolve().parent / "scripts"
    folder = inside if inside.is_dir() else inside.parents[1] / "scripts"
    # By its path: `import scripts` might find another folder of that name in the current one.
    spec = importlib.util.spec_from_file_location(
        "scripts", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None
    assert spec.loader is not None
    sys.modules["scripts"] = package = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)
    return int(importlib.import_module("scripts.__main__").main())


def _stop_at_once(number: int, frame: FrameType | None) -> None:
    """Handle Ctrl-C while the command line is imported, and at exit."""
    os.write(2, b"endotwin: stopped\n")
    os._exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
