"""`endotwin control`: closed-loop tracking of a bend on the twin, by every controller."""

import dataclasses
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from scripts.command import Options, Summary, command_line, complain, options_of, run_verb
from scripts.outputs import output_folder
from scripts.progress import Progress
from twin.files.atomic import MADE_BY

if TYPE_CHECKING:
    from twin.control.conditions import ControlCondition, ControlSettings
    from twin.control.controller import ControllerSpec
    from twin.control.results import Comparison

PAGE = "control.html"


@dataclasses.dataclass(frozen=True)
class Control(Options):
    """Track reference bends on randomised twins, by feed-forward and by feedback.

    Each controller is tuned with the same number of trials on other twins than are scored, and runs on the
    same twins, references and noise. The same command continues a stopped comparison; with more controllers
    or conditions, existing results are kept. The conditions of the suite sealed have physics that no twin of
    RAM (twins) has, drawn by a hash of the policies and --seed: a changed policy meets others.

    Examples:
        endotwin control --controller linear pid --out results/control
        endotwin control --policy runs/ram_twins/policy.onnx --suite full --out results/control_full
    """

    GROUPS: ClassVar = {
        "Controllers": "policy",
        "Conditions": "suite",
        "Work": "candidates",
    }

    out: Path
    """Folder for control.json, page, table, figures and recordings."""
    preset: str = "ureteroscope"
    """Endoscope: name of a preset, or a YAML file with ranges."""
    policy: Path | None = None
    """Trained file of RAM (twins); without it, the controllers that need one are left out."""
    tracking_policy: Path | None = None
    """Policy that PPO trained to track (docs/control.md); without it, ppo is left out."""
    controller: tuple[str, ...] = ("all",)
    """Names of controllers, of those in docs/control.md, such as linear pid; or all."""
    suite: str = "short"
    """short: Gaussian noise of 1 deg^2 at 50 Hz; full: also other noises, 10 Hz, a fast reference, a sheath
    that bends, a contact at the tip, and endoscopes that no training saw; sealed: 12 that are drawn."""
    stroke: tuple[float, float] | None = None
    """Working stroke [mm]: references use the middle 65 % of its bend. [-1, 1] and [2, 4], if not given."""
    margin: float = 1.5
    """Command beyond the stroke to either side, as a share of its width: twins with more friction need it."""
    twins: int = 10
    """Randomised endoscopes that are controlled."""
    seconds: float = 40.0
    """Length of each reference [s], after a hold of 3 s that is not scored."""
    speed: float = 5.0
    """Speed limit of command and servo [mm/s]."""
    latency: float = 0.0
    """Delay of the sensor [s]."""
    preview: float = 1.0
    """Time ahead for which controllers know their reference [s]; 0: only the next sample."""
    physics: Literal["mujoco", "reduced"] = "mujoco"
    """Physics of the controlled endoscopes. Tuning is on reduced ones."""
    candidates: int = 16
    """Settings that are tried for each controller."""
    workers: int = 0
    """Processes; 0 for one per core. The results do not depend on it."""
    dask: str | None = None
    """Dask scheduler whose workers compute instead."""
    seed: int = 0
    """Seed of all random numbers."""


def control(args: Control) -> Summary:
    """Write `control.json`, page, table, figures and recordings."""
    from twin.errors import require_extra

    for extra in ("sim", "viz"):
        require_extra(extra, "endotwin control")
    from twin.control.comparison import compare, specs_of
    from twin.control.conditions import ControlSettings, find_conditions
    from twin.control.results import (
        CAPTION,
        RECORD_SIGN,
        RECORDS,
        RESULTS,
        TABLE,
        control_table,
        control_values,
        write_record,
        write_tables,
        write_values,
    )
    from twin.control.sealed import draw_conditions
    from twin.evaluation.protocol import SEALED
    from twin.evaluation.sealed import sealed_seed, test_set_name
    from twin.files.origin import origin_of
    from twin.files.run_folder import open_run
    from twin.preset import load_preset, load_ranges
    from twin.report.control_page import FIGURES, control_page
    from twin.workers.processes import choose_workers

    trained = [path for path in (args.policy, args.tracking_policy) if path is not None]
    test_set = ""
    if args.suite == SEALED:
        seed = sealed_seed(trained, args.seed)
        test_set, conditions = test_set_name(seed), draw_conditions(seed, args.seconds)
    else:
        conditions = find_conditions(args.suite)
    if args.physics == "reduced" and any(condition.tip_force for condition in conditions):
        complain("endotwin control: nothing touches the tip of a reduced twin: that condition is left out")
        conditions = tuple(condition for condition in conditions if not condition.tip_force)
    given = options_of(ControlSettings, args) | ({"strokes_mm": (args.stroke,)} if args.stroke else {})
    settings = ControlSettings(
        **given | {"preset": load_preset(args.preset)},
        ranges=load_ranges(args.preset),
        speed_mm_s=args.speed,
        latency_s=args.latency,
        preview_s=args.preview,
    )
    specs = specs_of(settings, args.controller)
    names = [spec.name for spec in specs]
    _check_tracking(settings, specs, conditions)
    _warn_of_training(settings)
    files = dict.fromkeys((TABLE, PAGE, *FIGURES), MADE_BY) | {RESULTS: '"control"'}
    files |= {f"{RECORDS}/{name}.mcap": RECORD_SIGN for name in names}
    out = output_folder(args.out, files)
    parts = len(names) * 2 * len(conditions)
    with (
        open_run(out, settings.to_dict(), ()),
        choose_workers(parts, args.workers or os.cpu_count() or 1, args.dask) as (executor, _),
    ):
        comparison = compare(settings, conditions, names, out, executor, Progress("control", "part"))
        ours = next((spec.name for spec in specs if spec.ours), None)
        origin = origin_of(command_line("control", args), trained)
        values = control_values(comparison, settings, ours, origin, test_set)
        for name, trial in comparison.shown.items():
            write_record(out, trial, settings, conditions[0], name)
        _draw(comparison, out, ours)
        write_tables(out, values)
        control_page(values, out).write(out / PAGE)
        path = write_values(out, values)
    line = f"{path}: {len(names)} controllers, {args.twins} twins, {len(conditions)} conditions"
    line += f", test set {test_set}" if test_set else ""
    return Summary(
        line,
        {"out": str(path), "controllers": names, "rows": len(values["rows"]), "test_set": test_set or None},
        table=f"{CAPTION} Smaller is better.\n\n{control_table(values['totals'], 'plain')}\n",
    )


def _check_tracking(
    settings: "ControlSettings", specs: "Sequence[ControllerSpec]", conditions: "Sequence[ControlCondition]"
) -> None:
    """Refuse a policy of another loop before any run, and state the conditions that it is left out of."""
    from twin.control.comparison import places_of
    from twin.control.controllers.ppo import load_tracking_policy

    if settings.tracking_policy is not None:
        first = conditions[0].sample_time
        load_tracking_policy(settings.tracking_policy).check(first, settings.speed_mm_s)
    for spec in specs:
        places = places_of(spec, settings, conditions)
        left_out = [of.name for place, of in enumerate(conditions) if place not in places]
        if left_out:
            complain(
                f"endotwin control: {spec.name} was trained at another T than that of: {', '.join(left_out)}"
            )


def _warn_of_training(settings: "ControlSettings") -> None:
    """Warn if commands may go beyond the training of RAM (twins): its monitor falls back there."""
    if settings.policy is None:
        return
    from twin.estimation.deployment import deployment_of
    from twin.estimation.learned.trained_file import read_trained_file

    low, high = deployment_of(read_trained_file(settings.policy)).pull_mm
    limits = [settings.limits(stroke) for stroke in settings.strokes_mm]
    least, most = min(of.low_mm for of in limits), max(of.high_mm for of in limits)
    if least < low or most > high:
        complain(
            f"endotwin control: commands may go from {least:g} to {most:g} mm, the trained file has met "
            f"{low:.3g} to {high:.3g}: beyond, its fallback is in charge (`endotwin train --stroke`)"
        )


def _draw(comparison: "Comparison", out: Path, ours: str | None) -> None:
    """Write the figures, and poses, with the first controller as a ghost of ours, if they can be drawn."""
    from twin.control.results import RECORDS
    from twin.files.atomic import write_whole
    from twin.recording import read_episode
    from twin.rendering.overlay import Overlay
    from twin.rendering.render import render
    from twin.report.control_page import (
        POSES,
        control_errors_figure,
        loop_comparison_figure,
        tracking_figure_of,
    )
    from twin.report.figures import to_png_bytes

    shown, condition = comparison.shown, comparison.results[0].condition
    first, own = next(iter(shown)), ours or list(shown)[-1]
    if first != own:
        before, after = (read_episode(out / RECORDS / f"{name}.mcap") for name in (first, own))
        try:
            render(Overlay(after, before, shown[own].reference_deg), out / POSES)
        except OSError as error:
            complain(f"endotwin control: no poses are drawn: {error}")
    figures = {
        "tracking.png": tracking_figure_of(shown, f"{condition.signals[0]}, {condition.name}, first twin"),
        "loops.png": loop_comparison_figure(shown, first, own),
        "errors.png": control_errors_figure(comparison.results),
    }
    for name, figure in figures.items():
        write_whole(out / name, to_png_bytes(figure))


main = partial(run_verb, Control, control)

if __name__ == "__main__":
    sys.exit(main())
