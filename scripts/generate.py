"""`endotwin generate`: simulate episodes of an endoscope into MCAP files, verify or replay them."""

import dataclasses
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from scripts.command import Options, Summary, compile_once, complain, run_verb, with_flags
from scripts.outputs import output_folder
from scripts.progress import Progress
from twin.errors import require_extra

if TYPE_CHECKING:
    from twin.dataset.write import Written


@dataclasses.dataclass(frozen=True)
class Generate(Options):
    """Simulate episodes of an endoscope into a folder of MCAP files and a dataset.json.

    A second run makes only what is missing or damaged. Flags override the recipe file.

    Examples:
        endotwin generate --stroke 2 4 --episodes 4 --seconds 60 --seed 1 --out data/train
        endotwin generate --physics reduced --episodes 64 --out data/bulk
    """

    GROUPS: ClassVar = {
        "What is simulated": "preset",
        "How it moves": "stroke",
        "Recorded command": "command_csv",
        "What is measured": "sample_time",
        "Output and work": "format",
    }

    recipe: Annotated[Path | None, tyro.conf.Positional] = None
    """Recipe in YAML (docs/dataset.md); without it, the flags and their defaults."""
    out: Path | None = None
    """Folder to write into."""
    preset: str | None = None
    """Name of a preset, or the path of a .yaml file; ureteroscope, if not given."""
    fidelity: str | None = None
    """fine, standard or fast: how finely the preset is divided; standard, if not given."""
    set: tuple[str, ...] = ()
    """Change parameters of the preset, in SI units."""
    randomize: bool = False
    """Draw the parameters of every episode, other than those set here, from the preset's ranges."""
    sheath_bend_deg: float | None = None
    """Bend the sheath by this instead of the preset's angle [deg]."""
    sheath_bend_to_deg: float | None = None
    """Bend it further, or less, evenly during each episode, to this angle [deg]."""
    physics: str | None = None
    """mujoco, or reduced: quasi-static, far faster, without gravity; mujoco, if not given."""
    stroke: tuple[float, float] | None = None
    """Lowest and highest pulling distance [mm]; 2 4, if not given."""
    lateral_stroke: tuple[float, float] | None = None
    """The same for the second bending plane, if the preset has two [mm]."""
    episodes: int | None = None
    """Number for each seed; if not given, one of each combination, at least 5. Signals alternate."""
    seconds: float | None = None
    """Length of each episode [s]; 60, if not given."""
    signal: str | None = None
    """sine, decaying-sine, triangle, multi-sine, random-steps, or all: each in turn."""
    command_csv: Path | None = None
    """Follow a recorded command instead: a CSV file, as `endotwin import` reads it."""
    command_column: str | None = None
    """Column with the command of wire a; if not given, pull_mm or command_deg, whichever exists."""
    command_unit: Literal["deg", "rad", "mm", "m"] | None = None
    """Unit of the command, if its column's name does not end in it; deg and rad: angle of the pulley."""
    lateral_command_column: str | None = None
    """Column with the command of wire c, for a preset with two bending planes."""
    time_column: str | None = None
    """Column with the time or phase; if not given, time_s or phase_rad, whichever exists."""
    time_unit: Literal["s", "ms", "us", "rad"] | None = None
    """Unit of the time, if its column's name does not end in it; rad for a phase."""
    seconds_per_cycle: float | None = None
    """Duration of 2 pi of a phase [s]; 20, if not given."""
    sample_time: float | None = None
    """Time between two samples [s]; 0.02, if not given."""
    sensor_variance: float | None = None
    """Variance of the noise on /measurement, added to the preset's [deg^2]; 0.1, if not given."""
    sensor: Literal["angle", "stereo"] | None = None
    """angle, of the preset; or stereo: /measurement from the pictures of two cameras (docs/vision.md)."""
    stereo: tuple[str, ...] = ()
    """Change parameters of the two cameras, as in method=silhouette blur_px=1.5."""
    pictures_per_second: float | None = None
    """Also record /camera/image, 320 x 240, at this rate [1/s]."""
    format: Literal["mcap", "csv"] = "mcap"
    """csv writes a table next to each MCAP file."""
    workers: int = 0
    """Processes; 0 for one per core. The bytes do not depend on it."""
    dask: str | None = None
    """Dask scheduler whose workers simulate; they need --out under the same path."""
    verify: bool = False
    """Check the dataset in --out instead: every hash and every number."""
    replay: Path | None = None
    """Simulate this MCAP file again instead, and compare the bytes."""
    seed: int | None = None
    """Seed of all random numbers; 0, if not given."""


def generate(args: Generate) -> Summary:
    """Write, verify or replay."""
    if args.replay is not None and args.verify:
        raise ValueError("--replay and --verify: choose one")
    if not args.verify:
        require_extra("sim")
    if args.replay is not None:
        return _replay(args.replay)
    if args.out is None:
        raise ValueError("--out: name the folder")
    return _verify(args.out) if args.verify else _write(args, args.out)


def _write(args: Generate, out: Path) -> Summary:
    from twin.dataset.recipe_file import change_recipe, read_recipe_file, resolve
    from twin.dataset.write import write_dataset
    from twin.workers.processes import choose_workers

    if args.episodes is not None and args.episodes < 1:
        raise ValueError(f"--episodes {args.episodes}: must be at least 1")
    if args.workers < 0:
        raise ValueError(f"--workers {args.workers}: must not be negative")
    values, folder = (read_recipe_file(args.recipe), args.recipe.parent) if args.recipe else ({}, Path())
    changes = _changes(args)
    origin = f"{args.recipe} with its flags" if args.recipe and changes else args.recipe
    recipe = resolve(change_recipe(values, changes), folder, origin)
    output_folder(out)
    if recipe.physics == "reduced":
        compile_once("endotwin generate", recipe.preset)
    with choose_workers(len(recipe.keys), args.workers, args.dask) as (executor, workers):
        csv, progress = args.format == "csv", Progress("generate", "ep")
        try:
            written = write_dataset(recipe, out, executor, workers=workers, csv=csv, on_progress=progress)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(": complete episodes are kept; the same command continues") from None
    if warning := recipe.unmet:
        complain(f"endotwin generate: {warning}")
    return _summary(out, recipe.preset.name, written)


def _changes(args: Generate) -> dict[str, Any]:
    from twin.preset.preset import parse_changes
    from twin.signals.excitation import SIGNALS

    if args.signal not in (None, "all", *SIGNALS):
        raise ValueError(f"unknown signal {args.signal!r}; valid: all, {', '.join(SIGNALS)}")
    start, end, rate = args.sheath_bend_deg, args.sheath_bend_to_deg, args.pictures_per_second
    given = {
        "preset": args.preset,
        "fidelity": args.fidelity,
        "set": parse_changes(args.set) or None,
        "randomize": args.randomize or None,
        "strokes_mm": args.stroke and [args.stroke],
        "lateral_stroke_mm": args.lateral_stroke,
        "episodes": args.episodes,
        "seconds": args.seconds,
        "sample_time_s": args.sample_time,
        "signals": args.signal and (list(SIGNALS) if args.signal == "all" else [args.signal]),
        "command_csv": _command(args) or None,
        "sheath_bends_deg": None if start is end is None else [start if end is None else (start, end)],
        "sensor": _sensor(args),
        "camera": None if rate is None else {"pictures_per_second": rate},
        "seeds": None if args.seed is None else [args.seed],
        "physics": args.physics,
    }
    if args.preset and args.preset.endswith((".yaml", ".yml")):
        given["preset"] = os.path.abspath(args.preset)
    return {key: value for key, value in given.items() if value is not None}


def _sensor(args: Generate) -> dict[str, Any] | None:
    """Return the flags of the sensor that are given, as the keys of a recipe's file."""
    if args.sensor == "angle" and args.stereo:
        raise ValueError("--sensor angle and --stereo: choose one")
    if args.sensor == "stereo" or args.stereo:
        require_extra("vision", "--sensor stereo")
        if args.sensor_variance is not None:
            raise ValueError("--sensor-variance and --sensor stereo: choose one")
        from twin.vision.rig import parse_rig

        return {"stereo": parse_rig(args.stereo) or True}
    given = {} if args.sensor_variance is None else {"variance_deg2": args.sensor_variance}
    return given | {"stereo": False} if args.sensor == "angle" else given or None


def _command(args: Generate) -> dict[str, Any]:
    """Return the flags of a recorded command that are given, as the keys of a recipe's file."""
    names = ("command_column", "command_unit", "lateral_command_column", "time_column", "time_unit")
    columns = {name: getattr(args, name) for name in (*names, "seconds_per_cycle")}
    given = {name: value for name, value in columns.items() if value is not None}
    if args.command_csv is not None:
        # Paths on the command line are relative to where it is typed, not to the recipe.
        return {"file": os.path.abspath(args.command_csv), **given}
    if given and args.recipe is None:
        flag = f"--{next(iter(given)).replace('_', '-')}"
        raise ValueError(f"{flag} is about --command-csv: name its file")
    return given


def _summary(folder: Path, preset: str, written: "Written") -> Summary:
    for damage in written.damage:
        complain(f"made again: {damage}")
    contents = {name: written.contents[name] for name in ("episodes", "seconds", "bytes")}
    line = f"{folder}: {_counted(contents['episodes'], 'episode')}, {contents['seconds']:g} s of {preset}"
    if written.kept:
        line += f"; {written.kept} of them there already"
    done = {"kept": written.kept, "made_anew": list(written.damage), "preset": preset}
    return Summary(line, {"out": str(folder), **contents, **done})


def _verify(folder: Path) -> Summary:
    from twin.dataset.verify import RULES, verify

    faults, episodes = verify(folder, on_progress=Progress("verify", "ep"))
    for fault in faults:
        complain(f"{fault.rule}: {with_flags(fault)}")
    broken = {fault.rule: sum(other.rule == fault.rule for other in faults) for fault in faults}
    table = "\n".join(
        f"  {_counted(broken[rule], 'fault') if rule in broken else 'holds':<9}  {rule:<11} {what}"
        for rule, what in RULES.items()
    )
    line = f"{folder}: all {episodes} episodes are complete, with the hashes and statistics of dataset.json"
    if faults:
        rules = ", ".join(broken)
        line = f"{folder}: {_counted(len(faults), 'fault')} in {_counted(episodes, 'episode')} ({rules})"
    values = {"out": str(folder), "episodes": episodes, "faults": faults, "rules": broken}
    return Summary(line, values, code=1 if faults else 0, table=table)


def _replay(path: Path) -> Summary:
    from twin.dataset.verify import replay

    result = replay(path)
    values = {"file": str(path), "same": result.same, "sha256": result.sha256, "differs": result.differs}
    return Summary(f"{path}: {result.line}", values, code=0 if result.same else 1)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


main = partial(run_verb, Generate, generate)

if __name__ == "__main__":
    sys.exit(main())
