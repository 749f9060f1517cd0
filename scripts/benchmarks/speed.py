"""Speed of the simulation, against a plain MuJoCo chain of the same size in the same run.

What one thread does is timed by its processor time, which others of the machine hardly change.
"""

import subprocess
import sys
import time
from functools import partial

import numpy as np

from scripts.benchmarks.harness import (
    SAMPLE_TIME,
    OnProgress,
    Result,
    in_turn,
    measurement,
    processor_seconds,
    sinusoid,
)
from twin.physics import Endoscope, simulate, simulate_batch
from twin.physics.plain_chain import run_plain_chain
from twin.preset.preset import Preset
from twin.signals.excitation import SIGNALS, command

PERIOD = 8.0


@measurement("speed_one_core")
def one_core(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of one endoscope, against a plain chain of the same nv."""
    pull = sinusoid(amplitude, PERIOD, 2)
    degrees = Endoscope.from_preset(preset).model.ptr.nv
    ours, theirs = in_turn(
        lambda: simulate(preset, pull, SAMPLE_TIME),
        lambda: run_plain_chain(degrees, preset.time_step, 2 * PERIOD),
        clock=time.process_time,
    )
    simulated = 2 * PERIOD + 1  # and the second of rest before a record
    peer = f"plain MuJoCo chain of nv = {degrees}"
    rates = simulated / ours, 2 * PERIOD / theirs
    return Result("speed on one core", rates[0], "times real time", ">= 100", None, peer, rates[1])


@measurement("speed_of_signals")
def of_signals(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure simulated seconds per second along each kind of signal, 20 s, against steps of 2.5 ms."""
    short, results = preset.replace(time_step=2.5e-3), {}
    for number, kind in enumerate(SIGNALS):
        rng = np.random.default_rng(number)
        pull = command(kind, (-amplitude, amplitude), 20.0, SAMPLE_TIME, rng)
        ours, theirs = in_turn(
            partial(simulate, preset, pull, SAMPLE_TIME),
            partial(simulate, short, pull, SAMPLE_TIME),
            repeats=3,
            clock=time.process_time,
        )
        results[f"speed_{kind}"] = Result(
            f"speed along a {kind}", 20 / ours, "times real time", "", None, "steps of 2.5 ms", 20 / theirs
        )
    return results


@measurement("speed_two_threads")
def two_threads(preset: Preset, amplitude: float) -> Result:
    """Measure simulated seconds per second of a batch on two threads, against one."""
    count = 32
    pulls = [sinusoid(amplitude, PERIOD, 2)] * count
    two, one = in_turn(
        lambda: simulate_batch([preset] * count, pulls, SAMPLE_TIME, threads=2),
        lambda: simulate_batch([preset] * count, pulls, SAMPLE_TIME, threads=1),
    )
    simulated = count * (2 * PERIOD + 1)
    name, bar, peer = (
        "speed of a batch on two threads",
        ">= 1.8 times one thread",
        "the same batch on one thread",
    )
    return Result(name, simulated / two, "times real time", bar, None, peer, simulated / one)


@measurement("cost_of_vertebrae")
def cost_of_vertebrae(preset: Preset, amplitude: float) -> Result:
    """Measure the time of a simulated second with 64 vertebrae, against 8."""
    pull = sinusoid(amplitude, 4.0, 1)
    few, many = (preset.replace(vertebrae=n) for n in (8, 64))
    slow, fast = in_turn(
        lambda: simulate(many, pull, SAMPLE_TIME),
        lambda: simulate(few, pull, SAMPLE_TIME),
        clock=time.process_time,
    )
    unit, bar = "s per simulated second", "<= 8 times that of 8"
    return Result("time of 64 vertebrae", slow / 5, unit, bar, None, "8 vertebrae", fast / 5)


@measurement("start")
def start(progress: OnProgress) -> dict[str, Result]:
    """Time `import twin` beyond Python's own start, and `endotwin VERB --help` of the slowest verb."""
    listed = subprocess.run(
        [sys.executable, "-P", "-m", "twin", "--help"], check=True, capture_output=True, text=True
    )
    verbs = [line.split()[0] for line in listed.stdout.splitlines() if line.startswith("  ")]
    python = _least("-c", "pass")
    imported = _least("-c", "import twin") - python
    slowest, longest = "", 0.0
    for done, verb in enumerate(verbs):
        progress(done, len(verbs))
        seconds = _least("-m", "twin", verb, "--help")
        slowest, longest = max((slowest, longest), (verb, seconds), key=lambda pair: pair[1])
    progress(len(verbs), len(verbs))
    name, peer = f"`endotwin {slowest} --help`, the slowest verb", "python itself"
    return {
        "start_import": Result("`import twin`", imported, "s", "< 0.15 s"),
        "start_help": Result(name, longest, "s", "< 0.5 s", None, peer, python),
    }


def _least(*words: str) -> float:
    """Return the least processor time of three runs [s]: others of this machine only add to it."""
    return min(processor_seconds(*words) for _ in range(3))
