"""A small folder that holds good input for every verb, and the commands that are tried on it."""

import json
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import briefly
import csv_logs
import pytest
import yaml
from small_dataset import SMALL
from typed import done

RECIPE = """\
preset: small.yaml
episodes: 2
seconds: 2
sample_time_s: 0.05
strokes_mm: [[-1, 1]]
seeds: [3]
randomize: true
"""
LEARN = "--model coleman_hodgdon.json --episodes 16 --horizon 64 --environments 4 --minibatch 32 --seed 1"
CALIBRATE = "calibrate short --preset tiny.yaml --starts 1 --sample-time 0.1"
EVALUATE = "evaluate data/test --model coleman_hodgdon.json --seeds 1"
POLICIES = "--policy runs/ram/policy.onnx runs/direct/policy.onnx runs/lstm/lstm.onnx"

BUILT = (
    "generate recipe.yaml --out data/train",
    "generate recipe.yaml --seed 4 --format csv --out data/test",
    "import log.csv --out measured --sheath-bend-deg 0 --seconds-per-cycle 1 --pulley-radius-mm 1",
    "import short.csv --out short --sheath-bend-deg 0 --seconds-per-cycle 1 --pulley-radius-mm 1",
    "identify data/train --out coleman_hodgdon.json --population 12 --generations 4 --monotone",
    f"{CALIBRATE} --free section_stiffness --out fitted.yaml",
    f"train data/train --agent ram --out runs/ram {LEARN}",
    f"train data/train --agent direct --out runs/direct {LEARN}",
    f"train data/train --agent lstm --out runs/lstm {LEARN}",
    f"{EVALUATE} {POLICIES} --train data/train --suite paper --out results",
    "run --policy runs/ram/policy.onnx data/test --out run.mcap",
    "render data/train --out bend.png",
    "render data/train --out bend.mp4 --size 160 120 --fps 5",
    "report . --out report.html",
)
"""Commands that fill the workspace, in this order."""


@dataclass(frozen=True)
class Command:
    """A command line that succeeds on the workspace.

    Attributes:
        line: words after `endotwin`.
        outputs: patterns of what it may write in its working folder when it succeeds.
        kept: patterns of what may stay when it fails, from which the same command continues.
        also: files that it reads and the line does not name.
        may_find: it may also end with exit status 1, having listed faults.
        slow: it takes seconds.
    """

    line: str
    outputs: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    may_find: bool = False
    slow: bool = False

    @property
    def words(self) -> list[str]:
        return shlex.split(self.line)

    def reads(self, root: Path) -> list[str]:
        """Files of the workspace that the line names, itself or by their folder."""
        found = {*self.also}
        for word, before in zip(self.words[1:], self.words, strict=False):
            path = root / word
            if before != "--out" and path.exists():
                inside = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
                found |= {one.relative_to(root).as_posix() for one in inside if not one.name.startswith(".")}
        return sorted(found)


MADE = ("made", "made/*")
DATASET = ("made/*.mcap", "made/*.csv", "made/.*", "made/recipe.yaml", "made/README.md")
TRAINED = ("made/config.yaml", "made/progress.csv", "made/checkpoint*", "made/.*")
FITTED = ("fitted*", ".fitted*")

COMMANDS = {
    "generate": Command("generate recipe.yaml --out made --format csv", MADE, DATASET, ("small.yaml",)),
    "generate again": Command(
        "generate recipe.yaml --out data/train",
        ("data/train/*",),
        ("data/train/*",),
        ("small.yaml", "data/train/dataset.json", "data/train/episode_0000.mcap"),
    ),
    "generate by flags": Command(
        "generate --preset small.yaml --set encoder_counts=400 --command-csv command.csv --episodes 1 "
        "--sample-time 0.05 --out made",
        MADE,
        DATASET,
    ),
    "verify": Command("generate --verify --out data/train", also=("data/train/dataset.json",), may_find=True),
    "replay": Command("generate --replay data/train/episode_0000.mcap", may_find=True),
    "import": Command("import log.csv --out made", MADE),
    "import again": Command("import log.csv --name other --out measured", ("measured/*",)),
    "export parquet": Command(
        "export data/train --out made", (*MADE, "made/*/*", "made/*/*/*", "made/*/*/*/*")
    ),
    "export csv": Command("export data/train --format csv --columns all --out made", MADE),
    "export mcap": Command("export data/train measured --format mcap --out made", MADE),
    "calibrate": Command(f"{CALIBRATE} --free sheath_friction --out fitted.yaml", FITTED, FITTED, slow=True),
    "identify": Command(
        "identify data/train measured --out made.json --population 8 --generations 2", ("made.json",)
    ),
    "train": Command(f"train data/train --agent ram --out made {LEARN}", MADE, TRAINED, slow=True),
    "train lstm": Command(f"train data/train --agent lstm --out made {LEARN}", MADE, TRAINED, slow=True),
    "evaluate": Command(
        f"{EVALUATE} --policy runs/ram/policy.onnx runs/lstm/lstm.onnx --methods C-H AM RAM LSTM "
        "--suite paper-only --write-estimates --out made",
        (*MADE, "made/estimates/*"),
        slow=True,
    ),
    "run": Command("run --policy runs/ram/policy.onnx data/test measured --out made.mcap", ("made.mcap",)),
    "render png": Command("render data/train --out made.png", ("made.png",), slow=True),
    "render mp4": Command("render data/train --out made.mp4 --size 160 120 --fps 5", ("made.mp4",)),
    "report": Command("report . --out made.html", ("made.html",), slow=True),
}


def matches(name: str, patterns: tuple[str, ...]) -> bool:
    """Whether a name is one of these; a star stays within a folder."""
    return any(p.count("/") == name.count("/") and fnmatchcase(name, p) for p in patterns)


def write_inputs(folder: Path) -> None:
    """Files that a user writes by hand."""
    (folder / "recipe.yaml").write_text(RECIPE)
    values = {key: value for key, value in SMALL.to_dict().items() if value != ""}
    (folder / "small.yaml").write_text(yaml.safe_dump(values | {"ranges": {"wire_stiffness": [7e3, 9e3]}}))
    tiny = values | {"vertebrae": 2, "sheath_elements": 1, "time_step": 5e-3}  # a calibration simulates often
    (folder / "tiny.yaml").write_text(yaml.safe_dump(tiny))
    (folder / "command.csv").write_text("time_s,pull_mm\n0,0\n0.5,1\n1.5,-1\n2,0\n")
    csv_logs.write(folder, csv_logs.LOOP)
    csv_logs.write(folder, {name: column[:32] for name, column in csv_logs.LOOP.items()}, "short.csv")


def build(folder: Path) -> dict[str, dict]:
    """Fill a folder by the commands themselves; the summary of each command by its line."""
    write_inputs(folder)
    with pytest.MonkeyPatch.context() as patch:
        briefly.tune_filters(patch)
        briefly.work_in_place(patch)
        return {line: json.loads(done(f"{line} --json", folder)) for line in BUILT}


@contextmanager
def copied(root: Path, into: Path) -> Iterator[Path]:
    """Context manager: a copy that may be changed, removed in the end."""
    work = Path(shutil.copytree(root, into, symlinks=True))
    try:
        yield work
    finally:
        for path in into.rglob("*"):
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o755)
        shutil.rmtree(into)
