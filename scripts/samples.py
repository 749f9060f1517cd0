"""`endotwin samples`: copy the sample logs and a tiny dataset that ship with the package."""

import dataclasses
import sys
from functools import partial
from pathlib import Path

from scripts.command import SeedIgnored, Summary, run_verb
from scripts.outputs import output_folder
from twin.errors import InputError
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole

SAMPLES = {
    "bench.csv": "90 s of a ureteroscope: time, pull, and an angle that a camera of 30 Hz sees",
    "bench.jsonl": "a live stream of the same bench, a JSON object each",
    "loop_000.csv": "loops of a manipulator, its sheath straight: time, command, angle, tensions",
    "loop_030.csv": "the same, its sheath bent by 30 deg",
    "loop_090.csv": "the same, by 90 deg",
    "loop_180.csv": "the same, by 180 deg",
    "two_planes.csv": "an endoscope that bends in two planes",
    "windows.csv": "pieces cut from a longer record, distinguished by a column",
    "samples.jsonl": "a live stream: time, pull, measurement and wanted angle, a JSON object each",
    "mixed.yaml": "a recipe: forty endoscopes, two strokes, a bending sheath",
    "dataset/dataset.json": "a dataset of two short episodes",
}
"""Samples by name, and what each holds. All are simulated: none was measured on a real endoscope."""


@dataclasses.dataclass(frozen=True)
class Samples(SeedIgnored):
    """Copy the sample logs and a tiny dataset that ship with EndoTwin into a folder.

    The commands of the documentation use them. All are simulated: none was measured on a real endoscope.

    Examples:
        endotwin samples --out .
        endotwin samples --out lab
    """

    out: Path = Path(".")
    """Folder to copy them into."""


def samples(args: Samples) -> Summary:
    """Copy the files."""
    paths = copy_samples(output_folder(args.out))
    table = "\n".join(f"  {name:<22} {what}" for name, what in SAMPLES.items())
    line = f"{args.out}: {len(paths)} files, all simulated: none was measured on a real endoscope"
    return Summary(line, {"out": str(args.out), "files": [str(path) for path in paths]}, table=table)


def sample_files() -> dict[str, Path]:
    """Return every file of the samples, by its path in the user's folder."""
    folder = assets_folder() / "samples"
    paths = [path for path in sorted(folder.rglob("[!.]*")) if path.is_file()]
    files = {str(path.relative_to(folder)): path for path in paths}
    return files | {"mixed.yaml": assets_folder() / "datasets" / "mixed.yaml"}


def copy_samples(out: Path) -> list[Path]:
    """Copy the samples into a folder that is there; another file of a sample's name is refused."""
    files = sample_files()
    for name, source in files.items():
        copy = out / name
        if copy.is_symlink() or (copy.exists() and copy.read_bytes() != source.read_bytes()):
            raise InputError(f"{copy} is there and is no copy of the sample: choose another folder")
    for name, source in files.items():
        (out / name).parent.mkdir(exist_ok=True)
        if not (out / name).exists():
            write_whole(out / name, source.read_bytes())
    return [out / name for name in files]


main = partial(run_verb, Samples, samples)

if __name__ == "__main__":
    sys.exit(main())
