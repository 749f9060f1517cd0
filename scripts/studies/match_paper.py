"""`python -m scripts.studies.match_paper`: fit the preset of the ureteroscope to the paper's tables."""

import dataclasses
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from scripts.command import Summary, complain, run_verb
from twin.errors import require_extra

if TYPE_CHECKING:
    from twin.calibration.published import Outcome
    from twin.preset.preset import Preset

MOST = 1000
MODEL = (1.15, 22.38, 5.0)
"""The paper's a [1/mm], b [deg/mm] and c [deg/mm]."""
STROKES = ((2e-3, 4e-3), (-1e-3, 1e-3))  # of identification and test [m]
SECONDS = 60.0
WITHIN = 0.15  # of the paper's RMSE of the active model
ROUGHLY = 0.5  # under two noises, at which the paper's AM is far better or worse than any of its model can be
ROUGH = {("gaussian", 5.0), ("poisson", 0.1)}
STATIC = (3.9, 5.3)  # RMSE of C-H, wrong start included, under the noises that it cannot depend on [deg]
MISFIT, STEADY = 1.15, 1.5  # [deg]
RADII, ROUND_WITHIN = (1e-3, 1.5e-3, 3e-3), 0.0275  # [m], of the radius


@dataclasses.dataclass(frozen=True)
class MatchPaper:
    """Fit a preset such that C-H and the active model have the paper's parameters and errors in it."""

    preset: str = "ureteroscope"
    """Preset to start from, and with every other parameter."""
    seeds: int = 10
    """Draws of the excitation, from 11 on: the first ten are left for a check."""
    episodes: tuple[int, int] = (4, 5)
    """Of each, as of `endotwin generate`: for the identification and for the test."""
    starts: int = 1
    """Starts of least squares: the preset itself, then draws from the priors."""
    steps: int = 20
    """Most steps from each."""
    seed: int = 0
    """Of the starts."""
    json: bool = False
    """Print the summary as one JSON object."""


def match_paper(args: MatchPaper) -> Summary:
    """Print the fitted parameters."""
    require_extra("sim")
    import numpy as np

    from twin.calibration.matching import match
    from twin.calibration.priors import URETEROSCOPE
    from twin.calibration.published import Commands, Published
    from twin.estimation.active_model import METHOD
    from twin.evaluation.paper import paper_value
    from twin.evaluation.protocol import PAPER_CONDITIONS
    from twin.files.bounds import check_between
    from twin.preset.file import load_preset

    for name in ("seeds", "starts", "steps"):
        check_between(name, getattr(args, name), 1, MOST)
    for number in args.episodes:
        check_between("episodes", number, 1, MOST)
    check_between("seed", args.seed, 0, 2**32 - 1)
    active = {}
    for kind, level in PAPER_CONDITIONS:
        value = paper_value(kind, level, METHOD, "rmse_deg")
        assert value is not None
        active[kind, level] = (value, ROUGHLY if (kind, level) in ROUGH else WITHIN)
    published = Published(MODEL, active, STATIC, MISFIT, STEADY, ROUND_WITHIN)
    base = load_preset(args.preset)
    commands = Commands.drawn(
        range(11, 11 + args.seeds), strokes=STROKES, episodes=args.episodes, seconds=SECONDS
    )
    rng = np.random.default_rng(args.seed)
    found = []
    for number in range(args.starts):
        complain(f"start {number + 1} of {args.starts}")
        start = rng.normal(size=len(URETEROSCOPE)) if number else None
        found.append(
            match(
                base,
                URETEROSCOPE,
                published,
                commands,
                radii=RADII,
                start=start,
                steps=args.steps,
                on_outcome=_show,
            )
        )
    preset, outcome, cost = min(found, key=lambda one: one[2])
    _show(preset, outcome, cost)
    values = {name: float(f"{getattr(preset, name):.4g}") for name in URETEROSCOPE}
    return Summary("\n".join(f"{name}: {value}" for name, value in values.items()), values)


def _show(preset: "Preset", outcome: "Outcome", cost: float) -> None:
    import numpy as np

    a, b, c = np.median(outcome.model, axis=0)
    rows = ", ".join(f"{row:.2f}" for row in outcome.active.mean(axis=0))
    complain(
        f"cost {cost:.1f}: a = {a:.3f}, b = {b:.2f}, c = {c:.2f}, misfit {outcome.misfit.mean():.2f} deg, "
        f"C-H {outcome.static.mean():.2f} ({outcome.steady.mean():.2f} after the start), AM {rows} deg"
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the script."""
    return run_verb(MatchPaper, match_paper, argv)


if __name__ == "__main__":
    sys.exit(main())
