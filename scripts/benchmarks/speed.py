"""Speed of the simulation, against a plain MuJoCo chain of the same size in the same run.

What one thread does is timed by its processor time, which others of the machine hardly change.
"""

import subprocess
import sys
import time
from collections.abc import Callable

import mujoco
import numpy as np

from scripts.benchmarks.harness import SAMPLE_TIME, Result, in_turn, sinusoid
from twin.episode import Record
from twin.estimation.active_model import ActiveModel, UnscentedActiveModel
from twin.estimation.adaptive import RobustActiveModel
from twin.estimation.open_loop import OpenLoop
from twin.evaluation.compare import compare
from twin.evaluation.method import as_method
from twin.evaluation.protocol import Protocol
from twin.hysteresis import ColemanHodgdon
from twin.physics import Endoscope, simulate, simulate_batch
from twin.preset.preset import Preset

PERIOD = 8.0


def run_plain_chain(degrees: int, time_step: float, seconds: float) -> None:
    """Simulate a chain of hinges with springs and damping: no wires, no friction, no contact."""
    spec = mujoco.MjSpec()
    spec.option.timestep = time_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody
    for _ in range(degrees):
        body = body.add_body(pos=[0.0025, 0, 0])
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            stiffness=[0.4, 0, 0],
            damping=[0.01, 0, 0],
            armature=1e-6,
        )
        body.mass, body.ipos, body.inertia, body.explicitinertial = 1e-5, [0, 0, 0], [1e-10] * 3, True
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.05
    mujoco.mj_step(model, data, round(seconds / time_step))


def one_core(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of one endoscope, against a plain chain of the same nv."""
    command = sinusoid(amplitude, PERIOD, 2)
    degrees = Endoscope.from_preset(preset).model.ptr.nv
    ours, theirs = in_turn(
        lambda: simulate(preset, command, SAMPLE_TIME),
        lambda: run_plain_chain(degrees, preset.time_step, 2 * PERIOD),
        clock=time.process_time,
    )
    simulated = 2 * PERIOD + 1  # and the second of rest before a record
    return Result(
        "speed on one core",
        simulated / ours,
        "times real time",
        ">= 100",
        simulated / ours >= 100,
        f"plain MuJoCo chain of nv = {degrees}",
        2 * PERIOD / theirs,
    )


def two_threads(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of a batch on two threads, against one."""
    count = 32
    commands = [sinusoid(amplitude, PERIOD, 2)] * count
    two, one = in_turn(
        lambda: simulate_batch([preset] * count, commands, SAMPLE_TIME, threads=2),
        lambda: simulate_batch([preset] * count, commands, SAMPLE_TIME, threads=1),
    )
    simulated = count * (2 * PERIOD + 1)
    return Result(
        "speed of a batch on two threads",
        simulated / two,
        "times real time",
        ">= 1.8 times one thread",
        one / two >= 1.8,
        "the same batch on one thread",
        simulated / one,
    )


def cost_of_vertebrae(preset: Preset, amplitude: float) -> Result:
    """Measure the time of a simulated second with 64 vertebrae, against 8."""
    command = sinusoid(amplitude, 4.0, 1)
    few, many = (preset.replace(vertebrae=n) for n in (8, 64))
    slow, fast = in_turn(
        lambda: simulate(many, command, SAMPLE_TIME),
        lambda: simulate(few, command, SAMPLE_TIME),
        clock=time.process_time,
    )
    return Result(
        "time of 64 vertebrae",
        slow / 5,
        "s per simulated second",
        "<= 8 times that of 8",
        slow / fast <= 8,
        "8 vertebrae",
        fast / 5,
    )


MODEL = ColemanHodgdon(1.15, 22.38, 5.0)
T, SAMPLES, SEEDS, RECORDS = 0.1, 600, 10, 5
LINEAR = 1.15  # twice the work may take this much more than twice the time: clocks are noisy


def cost_of_seeds(preset: Preset, amplitude: float) -> Result:
    """Measure the time of an evaluation with 40 seeds against 20."""
    return _doubled("seeds", amplitude, (2 * SEEDS, SAMPLES), (4 * SEEDS, SAMPLES))


def cost_of_samples(preset: Preset, amplitude: float) -> Result:
    """Measure the time of an evaluation of records of 120 s against 60 s."""
    return _doubled("samples", amplitude, (2 * SEEDS, SAMPLES), (2 * SEEDS, 2 * SAMPLES))


def _doubled(what: str, amplitude: float, one: tuple[int, int], two: tuple[int, int]) -> Result:
    taken = [[_seconds(amplitude, *size) for size in (one, two)] for _ in range(3)]
    first, second = np.min(taken, axis=0)
    return Result(
        f"evaluation with twice the {what}",
        float(second),
        "s",
        f"<= {2 * LINEAR:g} times that with half of them",
        bool(second <= 2 * LINEAR * first),
        peer="half of them",
        peer_value=float(first),
    )


def _seconds(amplitude: float, seeds: int, samples: int) -> float:
    pull = 1e3 * amplitude * np.sin(2 * np.pi * np.arange(samples) * T / 9)
    times = np.arange(samples, dtype=float) * T
    record = Record(times, pull, MODEL.response(pull, 0.0), name="m", source="model")
    kinds: tuple[type[ActiveModel], ...] = (ActiveModel, RobustActiveModel, UnscentedActiveModel)
    methods = [as_method(kind.__name__, kind(MODEL, T)) for kind in kinds]
    methods.append(as_method("static", OpenLoop(MODEL)))
    begin = time.process_time()
    compare([record] * RECORDS, methods, Protocol("full", seeds, T))
    return time.process_time() - begin


IMPORT_SECONDS, HELP_SECONDS = 0.15, 0.5
"""Processor time that `import twin` and `endotwin VERB --help` may take [s]."""
REPEATS = 3  # the least of them: others of this machine only add to it

_MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
"""


def processor_seconds(*words: str) -> float:
    """Return the least processor time [s] of a few runs of `python words`, user and system."""
    command = [sys.executable, "-P", "-c", _MEASURED, sys.executable, "-P", *words]
    runs = [subprocess.run(command, check=True, capture_output=True, text=True) for _ in range(REPEATS)]
    return min(float(run.stdout) for run in runs)


def start(on_progress: Callable[[int, int], None]) -> dict[str, Result]:
    """Time `import twin` beyond Python's own start, and `endotwin VERB --help` of the slowest verb."""
    listed = subprocess.run(
        [sys.executable, "-P", "-m", "twin", "--help"], check=True, capture_output=True, text=True
    )
    verbs = [line.split()[0] for line in listed.stdout.splitlines() if line.startswith("  ")]
    python = processor_seconds("-c", "pass")
    imported = processor_seconds("-c", "import twin") - python
    slowest, longest = "", 0.0
    for done, verb in enumerate(verbs):
        on_progress(done, len(verbs))
        seconds = processor_seconds("-m", "twin", verb, "--help")
        slowest, longest = max((slowest, longest), (verb, seconds), key=lambda pair: pair[1])
    on_progress(len(verbs), len(verbs))
    return {
        "start_import": Result(
            "`import twin`", imported, "s", f"below {IMPORT_SECONDS:g} s", imported < IMPORT_SECONDS
        ),
        "start_help": Result(
            f"`endotwin {slowest} --help`, the slowest verb",
            longest,
            "s",
            f"below {HELP_SECONDS:g} s",
            longest < HELP_SECONDS,
            "python itself",
            python,
        ),
    }
