"""`endotwin demo`: the complete pipeline, end to end, by the commands that a user would type."""

import dataclasses
import json
import os
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scripts.command import Options, Summary, run_verb, say
from scripts.outputs import output_folder
from twin import __version__
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.json_text import read_json

PACKAGES = ("mujoco", "dm-control", "numpy", "gymnasium", "stable-baselines3", "torch", "mcap")
PRESET = "ureteroscope"
MARK = "demo.json"
MOST = 1_000_000  # of anything that is counted, and of seconds
PARTS = ("data", "runs", "results", "coleman_hodgdon.json", "bend.png", "bend.mp4", "report.html")


@dataclasses.dataclass(frozen=True)
class Demo(Options):
    """Dataset, identification, training, evaluation, pictures and report, each a command that is printed.

    Examples:
        endotwin demo --out out/demo
        endotwin demo --episodes 500 --seconds 30 --out out/short
    """

    out: Path = Path("out/demo")
    """Run folder; a stopped demo of the same settings continues there, results of another one are kept."""
    episodes: int = 2000
    """Episodes of PPO; the steps of a network scale with them, those of RAM (twins) with a tenth of them."""
    records: int = 5
    """Records of the training set, and as many of the test set: one of each kind of signal."""
    seconds: float = 60.0
    """Length of a record [s]."""
    seeds: int = 20
    """Draws of the noise under test."""
    seed: int = 1
    """Seed of all random numbers."""


def demo(args: Demo) -> Summary:
    """Run every stage and write `report.html`."""
    from twin.estimation.learned.methods import POLICY_FILE
    from twin.estimation.registry import method_specs

    for name in ("episodes", "records", "seconds", "seeds"):
        if not 0 < getattr(args, name) <= MOST:
            raise InputError(f"--{name} {getattr(args, name)}: must be positive, at most {MOST}")
    settings = {name: getattr(args, name) for name in ("episodes", "records", "seconds", "seeds", "seed")}
    folder = _claimed_folder(args.out, settings | {"endotwin": __version__})
    out = shlex.quote(str(folder))  # as it stands in the commands
    data, model, runs = f"{out}/data", f"{out}/coleman_hodgdon.json", f"{out}/runs"
    generate = f"generate --preset {PRESET} --episodes {args.records} --seconds {args.seconds:g}"
    learn = (
        f"train {data}/train --model {model} --protocol strict --seed {args.seed} --episodes {args.episodes}"
    )
    training = [
        spec.training for spec in method_specs() if spec.training and spec.presentation.in_paper_suite
    ]
    train = {made.agent: f"{learn} --agent {made.agent} --out {runs}/{made.agent}" for made in training}
    policies = [made.agent for made in training if made.file == POLICY_FILE]
    # A tenth of a complete training on twins: the demo takes minutes.
    share = max(args.episodes // 10, 1)
    twins = f"train --protocol twins --preset {PRESET} --seed {args.seed} --episodes {share}"
    ours = next(spec.training for spec in method_specs() if spec.presentation.leading and spec.training)
    given = " ".join(f"{runs}/{made.agent}/{made.file}" for made in (*training, ours))
    stages: dict[str, list[str]] = {
        "training data": [f"{generate} --stroke 2 4 --seed {args.seed} --out {data}/train"],
        "test data": [f"{generate} --stroke -1 1 --seed {args.seed + 1} --out {data}/test"],
        "identification": [f"identify {data}/train --seed {args.seed} --out {model}"],
        "pictures": [f"render {data}/test --out {out}/bend.png"],
        "training": [train[agent] for agent in policies],
        "networks, film": [
            *(command for agent, command in train.items() if agent not in policies),
            f"{twins} --agent {ours.agent} --out {runs}/{ours.agent}",
            f"render {data}/test --speed 4 --size 960 540 --out {out}/bend.mp4",
        ],
        "evaluation": [
            f"evaluate {data}/test --train {data}/train --model {model} --policy {given} "
            f"--suite paper --seeds {args.seeds} --seed {args.seed} --out {out}/results"
        ],
    }
    walls = {}
    start = time.monotonic()
    for number, (stage, commands) in enumerate(stages.items(), start=1):
        begin = time.monotonic()
        say(f"\n[{number}/{len(stages)}] {stage}", sys.stderr)
        _run_side_by_side(commands)
        walls[stage] = round(time.monotonic() - begin, 1)

    commands = [f"endotwin {command}" for group in stages.values() for command in group]
    facts = {
        "settings": settings | {"endotwin": __version__},
        "seed": args.seed,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "wall_time_s": {**walls, "all": round(time.monotonic() - start, 1)},
        "commands": commands,
    }
    write_whole(folder / MARK, json.dumps(facts, indent=2) + "\n")
    _run_side_by_side([f"report {out} --out {out}/report.html"])
    took = time.monotonic() - start
    return Summary(
        f"{folder}/report.html: the whole run in {took / 60:.1f} min",
        {"out": f"{folder}/report.html", "wall_time_s": round(took, 1)},
    )


def _claimed_folder(path: Path, settings: dict[str, Any]) -> Path:
    """Make the run folder, or take up the one of a demo with the same settings; others are refused."""
    folder, mark = output_folder(path), path / MARK
    held = [folder / part for part in PARTS if os.path.lexists(folder / part)]
    if not mark.is_file() or mark.is_symlink():
        if held or os.path.lexists(mark):
            there = held[0].name if held else MARK
            raise InputError(f"--out {folder} holds {there}, which no demo made: choose another folder")
        write_whole(mark, json.dumps({"settings": settings}, indent=2) + "\n")
        return folder
    try:
        held_settings = read_json(mark)["settings"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{mark} is not what a demo wrote: choose another folder, or remove it") from error
    if held_settings != settings:
        raise InputError(f"--out {folder} holds another demo: choose another folder, or remove it")
    return folder


def _run_side_by_side(commands: Sequence[str]) -> None:
    running: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            say(f"$ endotwin {command}", sys.stderr)
            # `-P`: not a folder called `twin` in the current one.
            words = [sys.executable, "-P", "-m", "twin", *shlex.split(command)]
            running.append(subprocess.Popen(words, stdout=sys.stderr))
        codes = [process.wait() for process in running]
    finally:
        for process in running:
            process.terminate()  # if this one is stopped; they clean up
        for process in running:
            process.wait()
    for command, code in zip(commands, codes, strict=True):
        if code:
            raise InputError(f"`endotwin {command}` ended with exit code {code}")


main = partial(run_verb, Demo, demo)

if __name__ == "__main__":
    sys.exit(main())
