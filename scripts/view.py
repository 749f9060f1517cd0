"""`endotwin view`: an endoscope in the browser, driven by sliders, or a recording that is played."""

import dataclasses
import getpass
import socket
import sys
import time
from functools import partial
from pathlib import Path

import tyro

from scripts.command import Options, Stopped, Summary, complain, run_verb
from twin.errors import InputError, require_extra

RECORDING = ".mcap"


@dataclasses.dataclass(frozen=True)
class View(Options):
    """Open an endoscope in the browser: pull its wires, bend the sheath, push the tip, change the friction.

    A page shows the endoscope in 3D, its loop, the tensions and, with --policy, the estimate of a trained
    estimator and its 95 % interval. A recording is played in the same page. It is served to this machine
    alone, until Ctrl-C.

    Examples:
        endotwin view --preset ureteroscope
        endotwin view data/train/episode_0000.mcap
    """

    source: tyro.conf.Positional[Path | None] = None
    """A recording to play, NAME.mcap; or what --preset takes."""
    preset: str = "ureteroscope"
    """Endoscope: name of a preset, or a YAML file."""
    policy: Path | None = None
    """Trained file of any method, which estimates the bend from noisy readings; it starts at rest."""
    seed: int = 0
    """Seed of the noise of these readings."""
    port: int = 8080
    """Port on 127.0.0.1; 0 for a free one."""


def view(args: View) -> Summary:
    """Serve the page until a signal comes."""
    from twin.files.bounds import check_between
    from twin.preset import load_preset

    check_between("port", args.port, 0, 65_535)
    require_extra("view")
    require_extra("sim")
    from scripts.viewer import HOST, listen, serve
    from twin.view import LiveTwin, Playback

    if args.source is not None and args.source.suffix.lower() == RECORDING:
        if args.policy is not None:
            raise InputError("--policy: a recording shows its own estimate; `endotwin run` adds one to a log")
        session: LiveTwin | Playback = Playback(args.source)
    else:
        session = LiveTwin(load_preset(str(args.source or args.preset)), args.policy, args.seed)
    began = time.monotonic()
    try:
        with listen(args.port) as listening:
            port = listening.getsockname()[1]
            url = f"http://{HOST}:{port}"
            complain(f"endotwin view: open {url} in a browser; Ctrl-C ends it")
            there = f"{getpass.getuser()}@{socket.gethostname()}"
            complain(f"endotwin view: from another machine, first: ssh -L {port}:{HOST}:{port} {there}")
            serve(session, listening)
    except Stopped:
        seconds = time.monotonic() - began
    return Summary(f"{url}: closed after {seconds:.0f} s", {"url": url, "seconds": seconds})


main = partial(run_verb, View, view)

if __name__ == "__main__":
    sys.exit(main())
