"""`python -m scripts.match_paper`: fit the preset of the ureteroscope to the paper's a, b and c."""

import dataclasses
import sys
from collections.abc import Iterable, Sequence

from scripts.command import Summary, run_verb
from scripts.ending import complain
from twin.errors import require_extra

MOST_EPISODES = 1000
LARGEST_TARGET = 1e4


@dataclasses.dataclass(frozen=True)
class MatchPaper:
    """Fit a preset such that the Coleman-Hodgdon model of its loops has the paper's parameters."""

    preset: str = "ureteroscope"
    """Preset to start from."""
    target: tuple[float, float, float] = (1.15, 22.38, 5.0)
    """a [1/mm], b [deg/mm], c [deg/mm]."""
    stroke: tuple[float, float] = (2.0, 4.0)
    """Lowest and highest pulling distance [mm]."""
    episodes: int = 4
    """As of `endotwin generate`."""
    seconds: float = 60.0
    """As of `endotwin generate`."""
    seed: int = 1
    """As of `endotwin generate`."""
    json: bool = False
    """Print the summary as one JSON object."""


def match_paper(args: MatchPaper) -> Summary:
    """Print the fitted parameters."""
    require_extra("sim")
    from twin.calibration.matching import MATCHED, match, training_commands
    from twin.calibration.parameters import FreeParameters
    from twin.files.bounds import LONGEST_SECONDS, check_between
    from twin.preset.file import load_preset
    from twin.signals.plausible import LARGEST_PULL_MM

    check_between("episodes", args.episodes, 1, MOST_EPISODES)
    check_between("seconds", args.seconds, 1, LONGEST_SECONDS, "s")
    for name, value in zip("abc", args.target, strict=True):
        if not 0 < value <= LARGEST_TARGET:
            raise ValueError(f"--target: {name} = {value:g}: must be positive, at most {LARGEST_TARGET:g}")
    for end in args.stroke:
        check_between("stroke", end, -LARGEST_PULL_MM, LARGEST_PULL_MM, "mm")
    stroke = (args.stroke[0] * 1e-3, args.stroke[1] * 1e-3)
    commands = training_commands(stroke, args.episodes, args.seconds, args.seed)
    free = FreeParameters(load_preset(args.preset), MATCHED)
    preset = match(free, args.target, commands, on_iteration=_show)
    values = {name: float(f"{getattr(preset, name):.5g}") for name in MATCHED}
    return Summary(", ".join(f"{name}: {value}" for name, value in values.items()), values)


def _show(iteration: int, model: Iterable[float], rmse: float) -> None:
    a, b, c = model
    complain(f"{iteration}: a = {a:.4f}, b = {b:.3f}, c = {c:.3f}, RMSE {rmse:.3f} deg")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the script."""
    return run_verb(MatchPaper, match_paper, argv)


if __name__ == "__main__":
    sys.exit(main())
