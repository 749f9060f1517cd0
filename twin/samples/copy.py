"""Copying the samples that ship with the package into a folder of the user's."""

from pathlib import Path

from twin.errors import InputError
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole

SAMPLES = {
    "bench.csv": "a minute of a ureteroscope: time, pull, angle",
    "loop_000.csv": "loops of a manipulator, its sheath straight: time, command, angle, tensions",
    "loop_030.csv": "the same, its sheath bent by 30 deg",
    "loop_090.csv": "the same, by 90 deg",
    "loop_180.csv": "the same, by 180 deg",
    "two_planes.csv": "an endoscope that bends in two planes",
    "windows.csv": "pieces cut from a longer record, told apart by a column",
    "samples.jsonl": "a live stream: time, pull, measurement and wanted angle, a JSON object each",
    "mixed.yaml": "a recipe: forty endoscopes, two strokes, a bending sheath",
    "dataset/dataset.json": "a dataset of two short episodes",
}
"""Samples by name, and what each holds. All are simulated: none was measured on a real endoscope."""


def sample_files() -> dict[str, Path]:
    """Return every file of the samples, by its path in the user's folder."""
    folder = assets_folder() / "samples"
    files = {
        str(path.relative_to(folder)): path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    }
    return files | {"mixed.yaml": assets_folder() / "datasets" / "mixed.yaml"}


def copy_samples(out: Path) -> list[Path]:
    """Copy the samples into a folder; a file that is there already must be the same.

    Args:
        out: folder that is there.

    Returns:
        Paths of the copies.

    Raises:
        ValueError: another file of a sample's name is there.
    """
    files = sample_files()
    for name, source in files.items():
        there = out / name
        if there.is_symlink() or (there.exists() and there.read_bytes() != source.read_bytes()):
            raise InputError(f"{there} is there and is no copy of the sample: choose another folder")
    for name, source in files.items():
        (out / name).parent.mkdir(exist_ok=True)
        if not (out / name).exists():
            write_whole(out / name, source.read_bytes())
    return [out / name for name in files]
