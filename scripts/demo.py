"""`endotwin demo`: the whole pipeline, end to end, by the commands that a user would type."""

import dataclasses
import json
import platform
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from scripts.command import Summary, output_folder, run_verb

PACKAGES = ("mujoco", "dm-control", "numpy", "gymnasium", "stable-baselines3", "torch", "mcap")
MARK = "demo.json"
PARTS = ("data", "runs", "results", "coleman_hodgdon.json", "bend.png", "bend.mp4", "report.html")


@dataclasses.dataclass(frozen=True)
class Demo:
    """Dataset, identification, training, evaluation, pictures and report, each a command that is printed."""

    out: Path = Path("out/demo")
    """Run folder; what an earlier demo left in it is removed."""
    episodes: int = 2000
    """Episodes of PPO, the paper's number; a network takes as large a share of its own steps."""
    records: int = 5
    """Records of the training set, and as many of the test set: one of each kind of signal."""
    seconds: float = 60.0
    """Length of a record."""
    seeds: int = 20
    """Draws of the noise under test."""
    seed: int = 1
    json: bool = False
    """Print the summary as one JSON object."""


def demo(args: Demo) -> Summary:
    """Run every stage and write `report.html`."""
    from twin.estimation.learned.policy import POLICY_FILE
    from twin.estimation.registry import method_specs

    for name in ("episodes", "records", "seconds", "seeds"):
        if not getattr(args, name) > 0:
            raise ValueError(f"--{name} {getattr(args, name)}: must be positive")
    folder = _fresh_folder(args.out)
    out = shlex.quote(str(folder))  # as it stands in the commands
    data, model, runs = f"{out}/data", f"{out}/coleman_hodgdon.json", f"{out}/runs"
    generate = f"generate --preset ureteroscope --episodes {args.records} --seconds {args.seconds:g}"
    learn = (
        f"train {data}/train --model {model} --protocol strict --seed {args.seed} --episodes {args.episodes}"
    )
    training = [spec.training for spec in method_specs() if spec.training and spec.in_paper_suite]
    train = {made.agent: f"{learn} --agent {made.agent} --out {runs}/{made.agent}" for made in training}
    policies = [made.agent for made in training if made.file == POLICY_FILE]
    given = " ".join(f"{runs}/{made.agent}/{made.file}" for made in training)
    stages: dict[str, list[str]] = {
        "training data": [f"{generate} --stroke 2 4 --seed {args.seed} --out {data}/train"],
        "test data": [f"{generate} --stroke -1 1 --seed {args.seed + 1} --out {data}/test"],
        "identification": [f"identify {data}/train --seed {args.seed} --out {model}"],
        "pictures": [f"render {data}/test --out {out}/bend.png"],
        "training": [train[agent] for agent in policies],
        "networks, film": [
            *(command for agent, command in train.items() if agent not in policies),
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
        print(f"\n[{number}/{len(stages)}] {stage}", file=sys.stderr)
        _run_side_by_side(commands)
        walls[stage] = round(time.monotonic() - begin, 1)

    commands = [f"endotwin {command}" for group in stages.values() for command in group]
    facts = {
        "seed": args.seed,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "wall_time_s": {**walls, "all": round(time.monotonic() - start, 1)},
        "commands": commands,
    }
    (folder / MARK).write_text(json.dumps(facts, indent=2) + "\n")
    _run_side_by_side([f"report {out} --out {out}/report.html"])
    took = time.monotonic() - start
    return Summary(
        f"{folder}/report.html: the whole run in {took / 60:.1f} min",
        {"out": f"{folder}/report.html", "wall_time_s": round(took, 1)},
    )


def _fresh_folder(path: Path) -> Path:
    """Make the run folder, empty of what an earlier demo left in it.

    Raises:
        ValueError: it holds files of these names that no demo made.
    """
    folder = output_folder(path)
    held = [folder / part for part in PARTS if (folder / part).exists()]
    if held and not (folder / MARK).is_file():
        raise ValueError(f"--out {folder} holds {held[0].name}, which no demo made: choose another folder")
    for part in held:
        shutil.rmtree(part) if part.is_dir() else part.unlink()
    (folder / MARK).write_text("{}\n")
    return folder


def _run_side_by_side(commands: Sequence[str]) -> None:
    """Run commands at the same time and wait for all of them.

    Raises:
        ValueError: one of them failed.
    """
    running = []
    for command in commands:
        print(f"$ endotwin {command}", file=sys.stderr)
        # `-P`: not a folder called `twin` where the user happens to stand.
        words = [sys.executable, "-P", "-m", "twin", *shlex.split(command)]
        running.append(subprocess.Popen(words, stdout=sys.stderr))
    codes = [process.wait() for process in running]
    for command, code in zip(commands, codes, strict=True):
        if code:
            raise ValueError(f"`endotwin {command}` ended with exit code {code}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Demo, demo, argv)


if __name__ == "__main__":
    sys.exit(main())
