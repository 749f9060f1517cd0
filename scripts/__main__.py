"""`endotwin VERB`: finds the verb's file and runs it."""

import difflib
import importlib
import sys

from scripts.command import (
    MISTAKE,
    MODULES,
    complain,
    leave_at_once,
    prepare_streams,
    say,
    signals_handled_by,
)
from twin import __version__

VERBS = {
    "generate": "simulate episodes of an endoscope into a folder of MCAP files",
    "import": "read a measured log, a CSV file, into an MCAP file of the same form",
    "export": "convert episodes: to a LeRobot dataset in Parquet, as CSV, as MCAP",
    "calibrate": "fit the physical parameters of a preset to logs",
    "identify": "fit a model of hysteresis to records",
    "train": "train a learned estimator, on records or on simulated twins",
    "evaluate": "compare all methods under noise: tables, figures, evaluation.json",
    "run": "run a trained estimator on a log or a live stream, sample by sample",
    "render": "draw a record as PNG or MP4, without a screen",
    "view": "pull, bend and push an endoscope in the browser, or play a record",
    "report": "write a self-contained HTML page about a run",
    "control": "track a reference bend on the twin, by every controller",
    "gate": "go or no-go for a policy before it is deployed, with reasons",
    "samples": "copy the sample logs and a tiny dataset that ship with the package",
    "benchmark": "measure the speed, and the physics at full size",
    "demo": "the complete pipeline, end to end",
}


def main() -> int:
    """Run the verb that the command line names; returns the exit code."""
    with signals_handled_by(leave_at_once):  # until the verb works there is nothing to clean up
        prepare_streams()
        words = sys.argv[1:]
        if not words or words[0] in ("-h", "--help"):
            return _print(_help())
        if words[0] in ("-V", "--version"):
            return _print(f"endotwin {__version__}")
        verb, *rest = words
        if verb not in VERBS:
            close = difflib.get_close_matches(verb, VERBS, n=1)
            guess = f" (did you mean {close[0]!r}?)" if close else ""
            complain(f"endotwin: unknown verb {verb!r:.40}{guess}; valid: {', '.join(VERBS)}")
            return MISTAKE
        return int(importlib.import_module(f"scripts.{MODULES.get(verb, verb)}").main(rest))


def _print(text: str) -> int:
    if say(text):
        return 0
    complain("endotwin: standard output cannot be written: is its disk full?")
    return MISTAKE


def _help() -> str:
    lines = [f"  {verb:<10} {purpose}" for verb, purpose in VERBS.items()]
    return "\n".join(
        [
            "usage: endotwin VERB [options]",
            "",
            *lines,
            "",
            "`endotwin VERB --help` lists the options of a verb; `endotwin --version` prints the version.",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
