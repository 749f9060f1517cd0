"""`endotwin gate`: go or no-go for a trained policy, before it is deployed."""

import dataclasses
import sys
from functools import partial
from pathlib import Path

import tyro

from scripts.command import Options, Summary, command_line, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress

VERDICT_FILE = "gate.json"


@dataclasses.dataclass(frozen=True)
class Gate(Options):
    """Judge a trained policy on an endoscope: go or no-go, with reasons. Exit status 0 is go, 1 no-go.

    The policy is run on randomised twins that no training has seen, on your logs, on hostile inputs and on
    streams with faults, next to a tuned filter. A page argues the verdict and lists what was not shown.

    Examples:
        endotwin gate runs/device/policy.onnx data/measured --preset preset.yaml --out gate.html
        endotwin gate runs/ram_twins/policy.onnx --preset ureteroscope --quick --out gate.html
    """

    policy: tyro.conf.Positional[Path]
    """Trained file, as `endotwin train` writes it."""
    logs: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Logs of this endoscope: folders of MCAP files, or files."""
    preset: str = "ureteroscope"
    """Endoscope that the policy is to run on: name of a preset, or a YAML file with ranges."""
    out: Path = Path("gate.html")
    """Page to write; gate.json is written next to it."""
    sample_time: float | None = None
    """T [s]; if not given, that of the preset's sensor or, if it states none, of the training. Methods
    trained on records run only at the T of their training."""
    stroke: tuple[float, float] | None = None
    """Lowest and highest pull of the twins [mm]; if not given, that of the training, else of the logs."""
    sensor_zero_deg: float | None = None
    """Reading of the logs' sensor when the section is straight [deg]; that of the preset, if not given."""
    sensor_zero_deviation_deg: float | None = None
    """Standard deviation of that zero [deg], 0 if it is calibrated; that of the preset, if not given."""
    sensor_lag_s: float | None = None
    """Age of its readings when they arrive [s]; that of the preset, if not given."""
    quick: bool = False
    """Fewer twins and shorter streams, for a first look; the page states this."""
    seed: int = 0
    """Seed of all random numbers."""


def gate(args: Gate) -> Summary:
    """Write page and `gate.json`."""
    out = output_file(
        args.out, (".html",), companions={VERDICT_FILE: '"verdict"'}, inputs=(args.policy, *args.logs)
    )
    from twin.errors import require_extra

    for extra in ("sim", "viz"):
        require_extra(extra, "endotwin gate")
    from twin.files.origin import Origin, origin_of
    from twin.gate import QUICK, WHOLE, gather, run_gate
    from twin.gate.page import gate_page
    from twin.gate.run import write_verdict
    from twin.preset import load_preset, load_ranges
    from twin.preset.sensor import SensorModel
    from twin.recording import read_dataset

    preset, ranges = load_preset(args.preset), load_ranges(args.preset)
    material = gather(
        args.policy,
        preset,
        ranges,
        [episode for path in args.logs for episode in read_dataset(path, hidden=False)],
        stroke_mm=args.stroke,
        sample_time=args.sample_time,
        seed=args.seed,
        size=QUICK if args.quick else WHOLE,
        sensor=SensorModel.of(preset).replace(
            zero_deg=args.sensor_zero_deg,
            zero_deviation_deg=args.sensor_zero_deviation_deg,
            lag_s=args.sensor_lag_s,
        ),
    )
    verdict = run_gate(material, Progress("gate"))
    given = [args.policy, *args.logs]
    origin = origin_of(command_line("gate", args), given)
    gate_page(verdict, Origin(**origin), str(out)).write(out)
    write_verdict(verdict, out.with_name(VERDICT_FILE), origin)
    first = verdict.reasons[0]
    lines = [f"  {check.word:<14} {check.name}: {check.said}" for check in verdict.checks]
    shown = first if verdict.go else f"{len(verdict.reasons)} reasons, the first: {first}"
    return Summary(
        f"{verdict.word}: {shown}; {out}",
        {"verdict": verdict.word, "reasons": list(verdict.reasons), "out": str(out)},
        code=int(not verdict.go),
        table="\n".join(lines),
    )


main = partial(run_verb, Gate, gate)

if __name__ == "__main__":
    sys.exit(main())
