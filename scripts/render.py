"""`endotwin render`: draw records as pictures or films, without a screen."""

import dataclasses
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import tyro

from scripts.command import SeedIgnored, Summary, options_of, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import require_extra

if TYPE_CHECKING:
    from twin.rendering.overlay import Overlay

COMMANDED = "commanded"


@dataclasses.dataclass(frozen=True)
class Render(SeedIgnored):
    """Draw the endoscope bending, next to its loop or reference; docs/rendering.md shows each option.

    A picture (.png, or .svg and .pdf with vector curves) shows four poses, or one; a film (.mp4, .gif) all of
    them.

    Examples:
        endotwin render dataset --out bend.png
        endotwin render data/test --out bend.mp4
    """

    GROUPS: ClassVar = {
        "What is drawn": "camera",
        "Picture": "time",
        "Film": "fps",
        "Look": "background",
    }

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files; several are drawn side by side."""
    out: Path
    """File to write; its ending sets the kind."""
    camera: str = "side"
    """side, top, tip, overview (with sheath and pulley), or endoscopic (view from the tip)."""
    ghost: str | None = None
    """Pale overlay: another run (.mcap, at the same times), a model (.json), or `commanded`."""
    episode: int = 0
    """Number of the file in a folder, in the order of names."""
    panels: str = "both"
    """both (endoscope and curves), view or curves."""
    time: float | None = None
    """Draw the pose at this time [s] instead of four poses."""
    sheet: int | None = None
    """Draw a contact sheet of this many poses at even times."""
    dpi: int = 200
    """Pixels per inch; with --size, it sets the size of text."""
    fps: int = 25
    """Frames per second."""
    speed: float = 1.0
    """Seconds of the record per second of the film; shown in the film."""
    background: str = "white"
    """white, dark or transparent."""
    transparent: bool = False
    """The same as --background transparent."""
    sleeve: str = "cut"
    """Sleeve of the bending section: cut (open to the viewer), whole or none."""
    size: tuple[int, int] | None = None
    """Width and height [pixels]; 1280 720 for a film, as the figure needs for a picture."""


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
    look = Look(**options_of(Look, args) | {"background": _background(args)})
    overlays = [_overlay(path, args, number) for number, path in enumerate(args.data)]
    progress = Progress("render", "frame")
    film: dict[str, Any] = {"fps": args.fps, "speed": args.speed, "progress": progress}
    draw(overlays, out, look=look, time=args.time, sheet=args.sheet, **film)
    seconds = max(overlay.episode.time[-1] for overlay in overlays)
    return Summary(f"{out}: {seconds:g} s of {', '.join(map(str, args.data))}", {"out": str(out)})


def _background(args: Render) -> str:
    if args.transparent and args.background not in ("white", "transparent"):
        raise ValueError(f"--transparent and --background {args.background}: choose one")
    return "transparent" if args.transparent else args.background


def _overlay(path: Path, args: Render, number: int) -> "Overlay":
    """Return an episode with its ghost and reference; several have their names as titles."""
    from twin.hysteresis import load_model
    from twin.recording import episode_files, read_episode, read_estimates
    from twin.recording.messages import REFERENCE_TOPIC
    from twin.rendering.overlay import Overlay, with_command, with_model

    files = episode_files(path)
    if not 0 <= args.episode < len(files):
        raise ValueError(f"--episode {args.episode}: {path} holds 0 to {len(files) - 1}")
    file = files[args.episode]
    episode, reference_deg = read_episode(file), read_estimates(file, REFERENCE_TOPIC)
    if args.ghost == COMMANDED:
        overlay = with_command(episode, reference_deg)
    elif args.ghost is not None and args.ghost.lower().endswith(".json"):
        model = load_model(Path(args.ghost))
        overlay = with_model(episode, model, model.name.title())
    else:
        ghost = None if args.ghost is None else read_episode(Path(args.ghost))
        overlay = Overlay(episode, ghost, reference_deg)
    name = path.resolve().name if path.is_dir() else file.stem
    title = f"{number + 1}   {name}" if len(args.data) > 1 else ""
    return dataclasses.replace(overlay, title=title)


main = partial(run_verb, Render, render)

if __name__ == "__main__":
    sys.exit(main())
