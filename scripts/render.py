"""`endotwin render`: draw a record as PNG or MP4, without a screen."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

import tyro

from scripts.command import Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import require_extra


@dataclasses.dataclass(frozen=True)
class Render:
    """Draw the endoscope bending, beside its loop or reference: a film (.mp4) or poses (.png)."""

    data: tyro.conf.Positional[Path]
    """Folder of MCAP files, or one file."""
    out: Path
    """File to write; its ending says which."""
    ghost: Path | None = None
    """MCAP file of another run at the same times, drawn pale; a .png then shows where they differ most."""
    episode: int = 0
    """Number of the file in a folder, in the order of names."""
    fps: int = 25
    """Frames per second of a film."""
    speed: float = 1.0
    """Seconds of the record per second of the film."""
    size: tuple[int, int] = (1280, 720)
    """Width and height of a film [pixels]."""
    seed: int = 0
    """Nothing is drawn by chance; here for uniformity."""
    json: bool = False
    """Print the summary as one JSON object."""


def render(args: Render) -> Summary:
    """Write the picture or the film."""
    require_extra("sim")
    from twin.recording import episode_files, read_dataset, read_episode, read_estimates
    from twin.recording.estimate import REFERENCE_TOPIC
    from twin.rendering.beside import Beside
    from twin.rendering.render import render as draw

    read = [args.data] if args.ghost is None else [args.data, args.ghost]
    out = output_file(args.out, (".png", ".mp4"), inputs=read)
    episodes = read_dataset(args.data)
    if not 0 <= args.episode < len(episodes):
        raise ValueError(f"--episode {args.episode}: {args.data} holds 0 to {len(episodes) - 1}")
    episode = episodes[args.episode]
    beside = Beside(
        ghost=None if args.ghost is None else read_episode(args.ghost),
        reference_deg=read_estimates(episode_files(args.data)[args.episode], REFERENCE_TOPIC),
    )
    width, height = args.size
    progress = Progress("render", "frame")
    size = {"width": width, "height": height}
    draw(episode, out, fps=args.fps, speed=args.speed, **size, beside=beside, progress=progress)
    return Summary(f"{out}: {episode.time[-1]:g} s of {args.data}", {"out": str(out)})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Render, render, argv)


if __name__ == "__main__":
    sys.exit(main())
