"""Sealed conditions of control: physics that no member has, drawn after the files under test are known.

The seed is that of `twin.evaluation.sealed.sealed_seed`: a changed policy meets other conditions. Each
condition has two kinds of physics, a family of noise, and endoscopes, references and noise of its own.
"""

from typing import Any

import numpy as np

from twin.control.conditions import CAPSTAN, ControlCondition
from twin.evaluation.sealed import VARIANCE_DEG2, draw_noise_sensor, log_uniform
from twin.signals.streams import SeedUse, random_stream

CONDITIONS = 12
SENSORS = 3  # values of R; every controller is tuned for each
FIELDS = {
    "wider twins": ("wider", (1.2, 2.0)),  # factor of the ranges of endoscopes
    "sheath bends": ("bends_by", (0.5, 3.0)),  # [rad]
    "tip touched": ("tip_force", (0.05, 0.2)),  # [N]
}
PARAMETERS = {
    "stick-slip": ("stiction", (0.2, 0.8)),  # excess of friction at rest [-]
    "capstan friction": (CAPSTAN[0][0], (0.1, 0.25)),
    "warm-up": ("friction_warm_up", (0.3, 1.0)),  # excess at the start of a run [-]
    "backlash": ("backlash", (1e-4, 5e-4)),  # [m]
}
"""Kinds of physics: what each sets, and the range of that, which is log-uniform."""
EVENT_AT = (0.2, 0.7)  # when a sheath bends or the tip is touched, as a share of the record


def draw_conditions(seed: int, seconds: float) -> tuple[ControlCondition, ...]:
    """Draw conditions for references of a length [s]."""
    rng = random_stream(seed, SeedUse.CONTROL_SEALED, CONDITIONS)
    variances = [log_uniform(VARIANCE_DEG2, rng) for _ in range(SENSORS)]
    return tuple(
        _draw(
            number, variances[number % SENSORS], seconds, random_stream(seed, SeedUse.CONTROL_SEALED, number)
        )
        for number in range(CONDITIONS)
    )


def _draw(number: int, variance: float, seconds: float, rng: np.random.Generator) -> ControlCondition:
    physics = FIELDS | PARAMETERS
    kinds = [[*physics][place] for place in sorted(rng.choice(len(physics), 2, replace=False))]
    drawn = {physics[kind][0]: log_uniform(physics[kind][1], rng) for kind in kinds}
    fields: dict[str, Any] = {name: drawn.pop(name) for name, _ in FIELDS.values() if name in drawn}
    if CAPSTAN[0][0] in drawn:
        drawn = dict(CAPSTAN) | drawn
    sensor = draw_noise_sensor(variance, rng)
    return ControlCondition(
        f"{number + 1}: {', '.join(kinds)}; {sensor.kind}, R = {variance:.2g}",
        sensor.kind,
        sensor.level,
        begins_s=rng.uniform(*EVENT_AT) * seconds,
        changes=tuple(drawn.items()),
        errors=sensor,
        seed=int(rng.integers(2**32)),
        **fields,
    )
