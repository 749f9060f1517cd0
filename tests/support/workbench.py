"""A small folder that holds good input for every verb, and the commands that are tried on it."""

from dataclasses import dataclass
from pathlib import Path

from small_dataset import SMALL

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
RENDER = "render data/train --out"


@dataclass(frozen=True)
class Command:
    """A command line that succeeds on the workbench.

    Attributes:
        name: in reports and in the names of cases.
        line: words after `endotwin`.
        outputs: patterns of what it may write in its working folder when it succeeds.
        kept: patterns of what of that may stay when it fails, as the same command goes on from there.
        may_find: it may also end with exit status 1, having listed faults.
        fails: it is stopped after its checks, as it is too long for a try; it never succeeds.
        kill: it is among those that are killed at any moment.
        slow: it takes seconds.
    """

    name: str
    line: str
    outputs: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    may_find: bool = False
    fails: bool = False
    kill: bool = False
    slow: bool = False

    @property
    def verb(self) -> str:
        return self.line.split()[0]


DATASET = ("made/*.mcap", "made/*.csv", "made/.endotwin*", "made/recipe.yaml", "made/.lock", "made/README.md")
TRAINED = ("config.yaml", "progress.csv", "checkpoint.state")
BUILT = (
    "generate recipe.yaml --out data/train",
    "generate recipe.yaml --seed 4 --out data/test",
    "import log.csv --out measured --sheath-bend-deg 0 --seconds-per-cycle 1 --pulley-radius-mm 1",
    "import short.csv --out short --sheath-bend-deg 0 --seconds-per-cycle 1 --pulley-radius-mm 1",
    "identify data/train --out coleman_hodgdon.json --population 12 --generations 4 --monotone",
    "identify data/train --model bouc-wen --out bouc_wen.json --population 12 --generations 2",
    f"train data/train --agent ram --out runs/ram {LEARN}",
    f"train data/train --agent lstm --out runs/lstm {LEARN}",
    "render data/train --out bend.png",
    "render data/train --out bend.mp4 --size 160 120 --fps 5",
    "evaluate data/test --model coleman_hodgdon.json --policy runs/ram/policy.onnx runs/lstm/lstm.onnx "
    "--methods C-H AM RAM LSTM --suite paper-only --seeds 1 --out results",
)
"""Commands that fill the workbench, in this order."""

COMMANDS = (
    Command("generate", "generate recipe.yaml --out made --format csv", ("made", "made/*"), DATASET),
    Command(
        "generate again",
        "generate recipe.yaml --out data/train",
        ("data/train/*",),
        tuple(name.replace("made", "data/train") for name in DATASET),
    ),
    Command(
        "generate by flags",
        "generate --preset small.yaml --set encoder_counts=400 --command-csv command.csv --episodes 1 "
        "--sample-time 0.05 --out made",
        ("made", "made/*"),
        DATASET,
    ),
    Command("verify", "generate --verify --out data/train", may_find=True),
    Command("replay", "generate --replay data/train/episode_0000.mcap", may_find=True),
    Command("import", "import log.csv --out made", ("made", "made/*"), kill=True),
    Command("import beside", "import log.csv --name other --out measured", ("measured/*",), kill=True),
    Command("export parquet", "export data/train --out made", ("made", "made/*"), kill=True),
    Command("export csv", "export data/train --format csv --columns all --out made", ("made", "made/*")),
    Command("export mcap", "export data/train measured --format mcap --out made", ("made", "made/*")),
    Command("export recover", "export data/train --recover --format mcap --out made", ("made", "made/*")),
    Command(
        "calibrate",
        f"{CALIBRATE} --free sheath_friction --out fitted.yaml",
        ("fitted*",),
        (".fitted*calibration*",),
        kill=True,
        slow=True,
    ),
    Command(
        "calibrate again",
        f"{CALIBRATE} --free section_stiffness --out taken.yaml",
        ("taken*", ".taken*"),
        (".taken*calibration*",),
        slow=True,
    ),
    Command(
        "identify",
        "identify data/train measured --out made.json --population 8 --generations 2",
        ("made.json",),
    ),
    Command(
        "identify bouc-wen",
        "identify data/train --model bouc-wen --out made.json --population 8 --generations 2",
        ("made.json",),
    ),
    Command(
        "train ram",
        f"train data/train --agent ram --out made {LEARN}",
        ("made", "made/*"),
        tuple(f"made/{name}" for name in TRAINED),
        kill=True,
    ),
    Command(
        "train again",
        f"train data/train --agent ram --out stopped {LEARN}",
        ("stopped/*",),
        tuple(f"stopped/{name}" for name in TRAINED),
    ),
    Command(
        "train lstm",
        f"train data/train --agent lstm --out made {LEARN}",
        ("made", "made/*"),
        tuple(f"made/{name}" for name in TRAINED),
    ),
    Command(
        "evaluate",
        "evaluate data/test --model coleman_hodgdon.json --policy runs/ram/policy.onnx runs/lstm/lstm.onnx "
        "--methods C-H AM RAM LSTM --suite paper-only --seeds 1 --write-estimates --out made",
        ("made", "made/*"),
        kill=True,
        slow=True,
    ),
    Command(
        "evaluate and train",
        "evaluate data/test --train data/train --policy runs/lstm/lstm.onnx --methods C-H RAM "
        "--episodes 16 --suite paper-only --seeds 1 --out results",
        ("results/*", "results/ram/*"),
        ("results/ram", *(f"results/ram/{name}" for name in (*TRAINED, "policy.onnx"))),
        slow=True,
    ),
    Command(
        "run",
        "run --policy runs/ram/policy.onnx data/test measured --out made.mcap",
        ("made.mcap",),
        kill=True,
    ),
    Command(
        "run into a folder", "run --policy runs/ram/policy.onnx data/test --out made", ("made", "made/*")
    ),
    Command("render png", f"{RENDER} made.png", ("made.png",), slow=True),
    Command("render mp4", f"{RENDER} made.mp4 --size 160 120 --fps 5", ("made.mp4",), kill=True),
    Command("report", "report . --out made.html", ("made.html",), kill=True, slow=True),
    Command(
        "benchmark",
        "benchmark --preset small.yaml --amplitude 1 --only return_point --out made.json",
        ("made.json", "made.md"),
        may_find=True,
        slow=True,
    ),
    Command(
        "demo",
        "demo --out made --records 1 --seconds 2 --episodes 16",
        ("made",),
        ("made/demo.json",),
        fails=True,
    ),
)
BY_NAME = {command.name: command for command in COMMANDS}


def write_inputs(folder: Path) -> None:
    """Files that a user writes by hand."""
    import csv_logs
    import yaml

    (folder / "recipe.yaml").write_text(RECIPE)
    values = {key: value for key, value in SMALL.to_dict().items() if value != ""}
    values["ranges"] = {"wire_stiffness": [7000.0, 9000.0]}
    (folder / "small.yaml").write_text(yaml.safe_dump(values))
    (folder / "command.csv").write_text("time_s,pull_mm\n0,0\n0.5,1\n1.5,-1\n2,0\n")
    tiny = values | {"vertebrae": 2, "sheath_elements": 1, "time_step": 5e-3}  # a calibration simulates often
    (folder / "tiny.yaml").write_text(yaml.safe_dump({key: tiny[key] for key in tiny if key != "ranges"}))
    csv_logs.write(folder, csv_logs.LOOP)
    csv_logs.write(folder, {name: column[:32] for name, column in csv_logs.LOOP.items()}, "short.csv")
    (folder / "demo.json").write_text('{"seed": 1, "versions": {}, "wall_time_s": {}, "commands": []}\n')
