"""`endotwin generate`: simulate episodes of an endoscope into MCAP files, verify or replay them."""

import contextlib
import dataclasses
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from scripts.command import Progress, Summary, output_folder, run_verb, with_flags
from twin.dataset.recipe import Recipe
from twin.dataset.recipe_file import read_recipe_file, resolve
from twin.dataset.verify import replay, verify
from twin.dataset.write import Written, write_dataset
from twin.preset.preset import parse_changes
from twin.signals.excitation import SIGNALS
from twin.workers.dask_cluster import dask_workers
from twin.workers.processes import local_workers


@dataclasses.dataclass(frozen=True)
class Generate:
    """Simulate episodes of an endoscope into a folder of MCAP files and a dataset.json.

    Run again, it makes only what is missing or damaged. Flags of the recipe go before what its file says.
    """

    recipe: Annotated[Path | None, tyro.conf.Positional] = None
    """A YAML file that says what to make (docs/dataset.md); without it, the flags and their defaults do."""
    out: Path | None = None
    """Folder to write into."""
    preset: str | None = None
    """Name of a preset, or the path of a .yaml file; ureteroscope, if not given."""
    set: tuple[str, ...] = ()
    """Change parameters of the preset: NAME=VALUE ..., in its SI units."""
    randomize: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Draw the parameters of every episode, other than those set here, from the preset's ranges."""
    stroke: tuple[float, float] | None = None
    """Lowest and highest pulling distance [mm]; 2 4, if not given."""
    lateral_stroke: tuple[float, float] | None = None
    """The same sideways, for a preset with two bending planes [mm]."""
    episodes: int | None = None
    """How many of each seed; if not given, one of each combination, at least 5. Signals are taken in turn."""
    seconds: float | None = None
    """Length of each episode; 60, if not given."""
    signal: str | None = None
    """sine, decaying-sine, triangle, multi-sine, random-steps, or all of them in turn."""
    command_csv: Path | None = None
    """Follow a recorded command (pull_mm or command_deg, over time_s or phase_rad) instead."""
    sheath_bend_deg: float | None = None
    """Bend the sheath by this instead of the preset's angle [deg]."""
    sheath_bend_to_deg: float | None = None
    """Bend it further, or less, evenly during each episode, to this angle [deg]."""
    sample_time: float | None = None
    """Time between two samples [s]; 0.02, if not given."""
    sensor_variance: float | None = None
    """Variance of noise that /measurement gets besides the preset's sensor [deg^2]; 0.1, if not given."""
    camera: float | None = None
    """Pictures per second of /camera/image, 320 x 240; none, if not given."""
    format: Literal["mcap", "csv"] = "mcap"
    """csv writes a table beside each MCAP file."""
    workers: int = 0
    """Processes; 0 for one per core. The bytes do not depend on it."""
    dask: str | None = None
    """Address of a Dask scheduler, whose workers do the work and see --out under the same path."""
    verify: bool = False
    """Check the dataset in --out instead: every hash and every number."""
    replay: Path | None = None
    """Simulate this MCAP file again instead, and compare the bytes."""
    seed: int | None = None
    """0, if not given."""
    json: bool = False
    """Print the summary as one JSON object."""


def generate(args: Generate) -> Summary:
    """Write, verify or replay."""
    if args.replay is not None and args.verify:
        raise ValueError("--replay and --verify: choose one")
    if args.replay is not None:
        return _replay(args.replay)
    if args.out is None:
        raise ValueError("--out: name the folder")
    if args.verify:
        return _verify(args.out)
    if args.episodes is not None and args.episodes < 1:
        raise ValueError(f"--episodes {args.episodes}: must be at least 1")
    if args.workers < 0:
        raise ValueError(f"--workers {args.workers}: must not be negative")
    recipe = _recipe(args)
    with _executor(args, recipe) as (executor, workers):
        folder = output_folder(args.out)
        try:
            written = write_dataset(
                recipe,
                folder,
                executor,
                workers=workers,
                csv=args.format == "csv",
                on_progress=Progress("generate", "ep"),
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(": whole episodes stay, the same command goes on from there") from None
    _warn(recipe)
    return _summary(folder, recipe, written)


def _warn(recipe: Recipe) -> None:
    """Say that the episodes are too few to meet every stroke and bend that the recipe names."""
    all_met = [recipe.conditions(number) for number in range(recipe.episodes)]
    met = len({(one.stroke_mm, one.sheath_bend_deg) for one in all_met})
    named = len(recipe.strokes_mm) * max(len(recipe.sheath_bends_deg), 1)
    if met < named:
        print(
            f"endotwin generate: {_counted(recipe.episodes, 'episode')} of each seed meet only {met} of "
            f"{named} pairs of stroke and bend; for all, take {recipe.combinations}",
            file=sys.stderr,
        )


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _recipe(args: Generate) -> Recipe:
    """The recipe's file, changed by the flags that are given."""
    values: dict[str, Any] = {}
    folder = Path()
    if args.recipe is not None:
        values, folder = read_recipe_file(args.recipe), args.recipe.parent
    given: dict[str, Any] = {
        "lateral_stroke_mm": args.lateral_stroke,
        "episodes": args.episodes,
        "seconds": args.seconds,
        "sample_time_s": args.sample_time,
    }
    values |= {name: value for name, value in given.items() if value is not None}
    # Paths on the command line are relative to where it is typed, not to the recipe.
    if args.preset is not None:
        is_file = args.preset.endswith((".yaml", ".yml"))
        values["preset"] = str(Path(args.preset).resolve()) if is_file else args.preset
    if args.command_csv is not None:
        values["command_csv"] = str(args.command_csv.resolve())
        values.pop("given_pull_m", None)
    if args.set:
        values["set"] = {**(values.get("set") or {}), **parse_changes(args.set)}
    if args.randomize:
        values["randomize"] = True
        values.pop("ranges", None)
    if args.stroke is not None:
        values["strokes_mm"] = [args.stroke]
    if args.signal is not None:
        if args.signal not in ("all", *SIGNALS):
            raise ValueError(f"unknown signal {args.signal!r}; valid: all, {', '.join(SIGNALS)}")
        values["signals"] = list(SIGNALS) if args.signal == "all" else [args.signal]
    if args.sheath_bend_deg is not None or args.sheath_bend_to_deg is not None:
        start, end = args.sheath_bend_deg, args.sheath_bend_to_deg
        values["sheath_bends_deg"] = [start if end is None else (start, end)]
    if args.sensor_variance is not None:
        values["sensor"] = {**(values.get("sensor") or {}), "variance_deg2": args.sensor_variance}
    if args.camera is not None:
        values["camera"] = {**(values.get("camera") or {}), "pictures_per_second": args.camera}
    if args.seed is not None:
        values["seeds"] = [args.seed]
    return resolve(values, folder)


@contextlib.contextmanager
def _executor(args: Generate, recipe: Recipe) -> Iterator[tuple[Executor, int]]:
    """Where the work is done, and how many tasks at a time."""
    if args.dask is not None:
        with dask_workers(args.dask) as workers:
            yield workers
    else:
        count = min(args.workers or os.cpu_count() or 1, len(recipe.keys))
        with local_workers(count) as executor:
            yield executor, count


def _summary(folder: Path, recipe: Recipe, written: Written) -> Summary:
    contents = written.contents
    for damage in written.damage:
        print(f"made anew: {damage}", file=sys.stderr)
    episodes = _counted(contents["episodes"], "episode")
    line = f"{folder}: {episodes}, {contents['seconds']:g} s of {recipe.preset.name}"
    if written.kept:
        line += f"; {written.kept} of them there already"
    values = {
        "out": str(folder),
        "episodes": contents["episodes"],
        "seconds": contents["seconds"],
        "bytes": contents["bytes"],
        "kept": written.kept,
        "made_anew": list(written.damage),
        "preset": recipe.preset.name,
    }
    return Summary(line, values)


def _verify(folder: Path) -> Summary:
    faults, episodes = verify(folder, on_progress=Progress("verify", "ep"))
    for fault in faults:
        print(with_flags(fault), file=sys.stderr)
    line = f"{folder}: all {episodes} episodes are whole, their hashes and statistics as dataset.json says"
    if faults:
        line = f"{folder}: {_counted(len(faults), 'fault')} in {_counted(episodes, 'episode')}"
    return Summary(
        line, {"out": str(folder), "episodes": episodes, "faults": faults}, code=1 if faults else 0
    )


def _replay(path: Path) -> Summary:
    result = replay(path)
    return Summary(
        f"{path}: {result.line}",
        {"file": str(path), "same": result.same, "sha256": result.sha256, "differs": result.differs},
        code=0 if result.same else 1,
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Generate, generate, argv)


if __name__ == "__main__":
    sys.exit(main())
