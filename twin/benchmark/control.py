"""Time of one step of hysteresis compensation: estimate, monitor, inverse of the members, and the command."""

import itertools
import time
from pathlib import Path

import numpy as np

from twin.benchmark.result import Result
from twin.estimation.learned.trained_file import read_trained_file
from twin.preset.preset import Preset

SECONDS = 60.0
T = 0.02  # [s]
STROKE_MM = (-1.0, 1.0)
NOISE_VARIANCE = 1.0  # [deg^2]


def control_step(policy: Path, preset: Preset) -> dict[str, Result]:
    """Measure a controller on a trained file of RAM (twins), in a closed loop with a reduced twin."""
    from twin.control.conditions import PREVIEW_S, reference
    from twin.control.controller import MARGIN, CommandLimits, ControlKnowledge, Sensed
    from twin.control.controllers.inverses import MEMBERS_INVERSE
    from twin.control.trial import Plant
    from twin.estimation.deployment import deployment_of

    deployment = deployment_of(read_trained_file(policy))
    limits = CommandLimits(*STROKE_MM, speed_mm_s=5.0).wider(MARGIN)
    known = ControlKnowledge(
        preset, STROKE_MM, limits, T, NOISE_VARIANCE, deployment, PREVIEW_S, policy=policy
    )
    controller, plant = MEMBERS_INVERSE.make(known), Plant(preset, T, "reduced")
    rng = np.random.default_rng(1)
    wanted = reference("multi-sine", known.line.reached_deg, SECONDS, T, rng)
    first = limits.nearest(known.line.pull_mm(wanted[0]))
    bend = plant.start(first)
    controller.start(first, float(wanted[0]))
    took, trusted = [], 0
    for k, (now, following) in enumerate(itertools.pairwise(wanted)):
        coming = wanted[k + 1 : k + 1 + round(PREVIEW_S / T)]
        sensed = Sensed(
            k * T, bend + rng.normal(0, NOISE_VARIANCE**0.5), float(now), float(following), coming
        )
        begun = time.perf_counter()
        pull = controller.step(sensed)
        took.append(1e3 * (time.perf_counter() - begun))
        trusted += not controller.falls_back
        bend = plant.step(pull)
    of = f"one step of control by the inverse of members, {100 * trusted / len(took):.0f} % of them trusted"
    took = took[len(took) // 10 :]  # the first ones are slower: code and memory are cold
    median, late = float(np.median(took)), float(np.percentile(took, 99))
    return {
        "control_step": Result(of, median, "ms", "below 2 ms", median < 2),
        "control_step_latest": Result(f"{of}, 99th percentile", late, "ms", "below 5 ms", late < 5),
    }
