"""Start of the library and of the command line: processor time until a user sees something."""

import subprocess
import sys
from collections.abc import Callable

from twin.benchmark.result import Result

IMPORT_SECONDS, HELP_SECONDS = 0.15, 0.5
"""Processor time that `import twin` and `endotwin VERB --help` may take [s]."""
REPEATS = 3  # the least of them: others of this machine only add to it

_MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
"""


def processor_seconds(*words: str) -> float:
    """Return the least processor time [s] of a few runs of `python words`, user and system."""
    command = [sys.executable, "-P", "-c", _MEASURED, sys.executable, "-P", *words]
    runs = [subprocess.run(command, check=True, capture_output=True, text=True) for _ in range(REPEATS)]
    return min(float(run.stdout) for run in runs)


def start(on_progress: Callable[[int, int], None]) -> dict[str, Result]:
    """Time `import twin` beyond Python's own start, and `endotwin VERB --help` of the slowest verb."""
    listed = subprocess.run(
        [sys.executable, "-P", "-m", "twin", "--help"], check=True, capture_output=True, text=True
    )
    verbs = [line.split()[0] for line in listed.stdout.splitlines() if line.startswith("  ")]
    python = processor_seconds("-c", "pass")
    imported = processor_seconds("-c", "import twin") - python
    slowest, longest = "", 0.0
    for done, verb in enumerate(verbs):
        on_progress(done, len(verbs))
        seconds = processor_seconds("-m", "twin", verb, "--help")
        slowest, longest = max((slowest, longest), (verb, seconds), key=lambda pair: pair[1])
    on_progress(len(verbs), len(verbs))
    return {
        "start_import": Result(
            "`import twin`", imported, "s", f"below {IMPORT_SECONDS:g} s", imported < IMPORT_SECONDS
        ),
        "start_help": Result(
            f"`endotwin {slowest} --help`, the slowest verb",
            longest,
            "s",
            f"below {HELP_SECONDS:g} s",
            longest < HELP_SECONDS,
            "python itself",
            python,
        ),
    }
