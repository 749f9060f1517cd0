"""Measure the noise `stereo-vision` of the comparison on a grid: `python -m scripts.studies.measure_stereo`.

It is run when the stereo sensor changes, and writes `assets/stereo_noise.json`.
"""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scripts.command import Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import require_extra

SIGN = '"hidden_s"'
"""Sign of the file in its own keys."""


@dataclasses.dataclass(frozen=True)
class MeasureStereo:
    """Measure the errors of the stereo sensor over [-90, 90] deg, and for how long instruments hide it."""

    out: Path
    """File to write, a .json."""
    preset: str = "ureteroscope"
    """Endoscope in front of the cameras."""
    rigs: int = 6
    """Number of rigs, which differ in their tolerances and in their calibration."""
    step: float = 1.0
    """Of the grid [deg]."""
    repeats: int = 4
    """Pairs of pictures at each angle, each with another distribution of the curvature."""
    frames: int = 6000
    """Pairs of pictures while instruments pass."""
    seed: int = 0
    """Of the first rig."""
    json: bool = False
    """Print the summary as one JSON object."""


def measure_stereo(args: MeasureStereo) -> Summary:
    """Write the file."""
    require_extra("vision")
    from twin.files.atomic import write_whole
    from twin.preset.file import load_preset
    from twin.vision.characteristic import FURTHEST_DEG, grid_errors, occluded
    from twin.vision.rig import StereoRig

    out = output_file(args.out, (".json",), SIGN)
    preset = load_preset(args.preset)
    bends = np.arange(-FURTHEST_DEG, FURTHEST_DEG + args.step / 2, args.step)
    errors = [
        grid_errors(
            preset, StereoRig(seed=args.seed + number), bends, args.repeats, Progress(f"rig {number}")
        )
        for number in range(args.rigs)
    ]
    rig = StereoRig(seed=args.seed, occlusions_per_minute=20.0)
    hidden = occluded(preset, rig, args.frames, Progress("passes"))
    contents = {
        "rig": {name: value for name, value in dataclasses.asdict(StereoRig()).items() if name != "seed"},
        "preset": args.preset,
        "bends_deg": bends.tolist(),
        "errors_deg": np.round(errors, 4).tolist(),
        "hides_per_pass": round(len(hidden.hidden_s) / hidden.passes, 4),
        "hidden_s": np.round(hidden.hidden_s, 3).tolist(),
    }
    write_whole(out, json.dumps(contents) + "\n")
    rmse = float(np.sqrt(np.nanmean(np.square(errors))))
    gaps = f"{hidden.passes} passes hid a marker {len(hidden.hidden_s)} times"
    line = f"{out}: RMSE {rmse:.3f} deg over {args.rigs} rigs; {gaps}"
    return Summary(line, {"out": str(out), "rmse_deg": rmse, "lost": int(np.isnan(errors).sum())})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the measurement."""
    return run_verb(MeasureStereo, measure_stereo, argv)


if __name__ == "__main__":
    sys.exit(main())
