"""`endotwin generate`: simulate episodes of an endoscope into a folder of MCAP files."""

import dataclasses
import multiprocessing
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np

from scripts.command import Progress, Summary, output_folder, run_verb
from twin.command_file import read_command
from twin.dataset import Recipe, write_dataset
from twin.excitation import SIGNALS
from twin.physics import check_sample_time
from twin.preset import load_preset, parse_changes
from twin.randomization import load_ranges


@dataclasses.dataclass(frozen=True)
class Generate:
    """Simulate episodes of an endoscope into a folder of MCAP files and a dataset.json."""

    out: Path
    """Folder to write into."""
    preset: str = "ureteroscope"
    """Name of a preset, or the path of a .yaml file."""
    set: tuple[str, ...] = ()
    """Change parameters of the preset: NAME=VALUE ..., in its SI units."""
    randomize: bool = False
    """Draw the parameters of every episode, other than those set here, from the preset's ranges."""
    stroke: tuple[float, float] = (2.0, 4.0)
    """Lowest and highest pulling distance [mm]."""
    lateral_stroke: tuple[float, float] | None = None
    """The same sideways, for a preset with two bending planes [mm]."""
    episodes: int = 5
    """How many; signals are taken in turn."""
    seconds: float = 60.0
    """Length of each episode."""
    signal: str = "all"
    """sine, decaying-sine, triangle, multi-sine, random-steps, or all of them in turn."""
    command_csv: Path | None = None
    """Follow a recorded command (pull_mm or command_deg, over time_s or phase_rad) instead."""
    sheath_bend_deg: float | None = None
    """Bend the sheath by this instead of the preset's angle [deg]."""
    sheath_bend_to_deg: float | None = None
    """Bend it further, or less, evenly during each episode, to this angle [deg]."""
    sample_time: float = 0.02
    """Time between two samples [s]."""
    sensor_variance: float = 0.1
    """Variance of noise that /measurement gets besides the preset's sensor [deg^2]; 0 for none."""
    format: Literal["mcap", "csv"] = "mcap"
    """csv writes a table beside each MCAP file."""
    workers: int = 0
    """Processes; 0 for one per core. The bytes do not depend on it."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def generate(args: Generate) -> Summary:
    """Write the dataset."""
    changes = parse_changes(args.set)
    preset = load_preset(args.preset).replace(**changes)
    chosen = set(changes)
    if args.sheath_bend_deg is not None:
        preset = preset.replace(sheath_bend=float(np.radians(args.sheath_bend_deg)))
        chosen.add("sheath_bend")
    bends = None
    if args.sheath_bend_to_deg is not None:
        bends = (preset.sheath_bend, float(np.radians(args.sheath_bend_to_deg)))
        chosen.add("sheath_bend")
    if args.signal not in ("all", *SIGNALS):
        raise ValueError(f"unknown signal {args.signal!r}; valid: all, {', '.join(SIGNALS)}")
    stroke = (args.stroke[0] * 1e-3, args.stroke[1] * 1e-3)
    lateral = args.lateral_stroke
    check_sample_time(preset, args.sample_time)
    given, episodes = None, args.episodes
    if args.command_csv is not None:
        pull = read_command(args.command_csv, preset, args.sample_time)
        given, stroke = tuple(pull.tolist()), (float(pull.min()), float(pull.max()))
        episodes = args.episodes if args.randomize else 1
    recipe = Recipe(
        preset=preset,
        stroke=stroke,
        lateral_stroke=None if lateral is None else (lateral[0] * 1e-3, lateral[1] * 1e-3),
        sheath_bend=bends,
        ranges=load_ranges(args.preset).without(chosen) if args.randomize else None,
        seconds=len(given) * args.sample_time if given else args.seconds,
        sample_time=args.sample_time,
        signals=tuple(SIGNALS) if args.signal == "all" else (args.signal,),
        sensor_variance_deg2=args.sensor_variance,
        seed=args.seed,
        given_command=given,
    )
    recipe.check()
    if episodes < 1:
        raise ValueError(f"--episodes {episodes}: must be at least 1")
    if args.workers < 0:
        raise ValueError(f"--workers {args.workers}: must not be negative")
    folder = output_folder(args.out)
    workers = min(args.workers or os.cpu_count() or 1, episodes)
    # Fresh processes: a fork would copy whatever threads and libraries this one has loaded.
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        contents = write_dataset(
            recipe,
            episodes,
            folder,
            executor,
            csv=args.format == "csv",
            on_episode=Progress("generate", "ep"),
        )
    seconds = len(contents["files"]) * recipe.seconds
    return Summary(
        f"{folder}: {len(contents['files'])} episodes, {seconds:g} s of {preset.name}",
        {"out": str(folder), "episodes": len(contents["files"]), "seconds": seconds, "preset": preset.name},
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Generate, generate, argv)


if __name__ == "__main__":
    sys.exit(main())
