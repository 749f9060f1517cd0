"""`endotwin render`: draw records as pictures or films, without a screen."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from scripts.command import Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import require_extra

if TYPE_CHECKING:
    from twin.evaluation.record import Array
    from twin.rendering.beside import Beside
    from twin.rendering.composition import Record

COMMANDED = "commanded"


@dataclasses.dataclass(frozen=True)
class Render:
    """Draw the endoscope bending, beside its loop or reference; docs/rendering.md shows each option.

    A picture (.png, or .svg and .pdf with vector curves) shows four poses, or one; a film (.mp4, .gif) all of
    them.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files; of several, each is drawn, side by side."""
    out: Path
    """File to write; its ending says which kind."""
    camera: str = "side"
    """side, top, tip, overview (with sheath and pulley), or endoscopic (what the tip sees)."""
    time: float | None = None
    """A picture of the pose at this time [s]."""
    sheet: int | None = None
    """A contact sheet of this many poses at even times."""
    ghost: str | None = None
    """Drawn pale behind it: another run (.mcap, at the same times), a model (.json), or `commanded`."""
    background: str = "white"
    """white, dark or transparent."""
    transparent: bool = False
    """The same as --background transparent."""
    sleeve: str = "cut"
    """Of the bending section: cut (open to the viewer), whole or none."""
    panels: str = "both"
    """both (endoscope and curves), view or curves."""
    size: tuple[int, int] | None = None
    """Width and height [pixels]; 1280 720 of a film, as the figure needs of a picture."""
    dpi: int = 200
    """Pixels per inch of a picture: with --size, it says how large text is."""
    episode: int = 0
    """Number of the file in a folder, in the order of names."""
    fps: int = 25
    """Frames per second of a film."""
    speed: float = 1.0
    """Seconds of the record per second of the film, which says so."""
    seed: int = 0
    """Nothing is drawn by chance; here for uniformity."""
    json: bool = False
    """Print the summary as one JSON object."""


def render(args: Render) -> Summary:
    """Write the picture or the film."""
    require_extra("sim")
    if not args.data:
        raise ValueError("no data given: name a folder of MCAP files, or a file")
    from twin.rendering.look import Look
    from twin.rendering.render import ENDINGS
    from twin.rendering.render import render as draw

    ghost = None if args.ghost in (None, COMMANDED) else Path(str(args.ghost))
    out = output_file(args.out, ENDINGS, inputs=[*args.data, *([ghost] if ghost else [])])
    look = Look(
        camera=args.camera,
        background=_background(args),
        sleeve=args.sleeve,
        panels=args.panels,
        size=args.size,
        dpi=args.dpi,
    )
    records = [_record(path, args, number) for number, path in enumerate(args.data)]
    progress = Progress("render", "frame")
    film: dict[str, Any] = {"speed": args.speed, "progress": progress}
    draw(records, out, look=look, time=args.time, sheet=args.sheet, fps=args.fps, **film)
    seconds = max(record.episode.time[-1] for record in records)
    return Summary(f"{out}: {seconds:g} s of {', '.join(map(str, args.data))}", {"out": str(out)})


def _background(args: Render) -> str:
    if args.transparent and args.background not in ("white", "transparent"):
        raise ValueError(f"--transparent and --background {args.background}: choose one")
    return "transparent" if args.transparent else args.background


def _record(path: Path, args: Render, number: int) -> "Record":
    """Return a record with what is drawn beside it; several have their names as titles."""
    from twin.recording import episode_files, read_episode, read_estimates
    from twin.recording.estimate import REFERENCE_TOPIC
    from twin.rendering.composition import Record

    files = episode_files(path)
    if not 0 <= args.episode < len(files):
        raise ValueError(f"--episode {args.episode}: {path} holds 0 to {len(files) - 1}")
    file = files[args.episode]
    episode = read_episode(file)
    beside = _beside(args.ghost, Record(episode), read_estimates(file, REFERENCE_TOPIC))
    name = path.resolve().name if path.is_dir() else file.stem
    title = f"{number + 1}   {name}" if len(args.data) > 1 else ""
    return Record(episode, beside, title)


def _beside(ghost: str | None, record: "Record", reference_deg: "Array") -> "Beside":
    from twin.hysteresis import load_model
    from twin.recording import read_episode
    from twin.rendering.beside import Beside
    from twin.rendering.ghosts import commanded_ghost, model_ghost

    if ghost is None:
        return Beside(reference_deg=reference_deg)
    if ghost == COMMANDED:
        return commanded_ghost(record.episode, reference_deg)
    if ghost.lower().endswith(".json"):
        model = load_model(Path(ghost))
        return model_ghost(record.episode, model, model.name.title())
    return Beside(ghost=read_episode(Path(ghost)), reference_deg=reference_deg)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Render, render, argv)


if __name__ == "__main__":
    sys.exit(main())
