"""Gains and outputs stay inside of their bounds, for all inputs by interval arithmetic, else by trial."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Sensor
from twin.estimation.learned.policy import PolicyEstimator
from twin.estimation.learned.scale import LEAST_VARIANCE
from twin.estimation.learned.trained_file import LARGEST
from twin.files.bounded import read_limited
from twin.files.bounds import SAMPLE_TIMES
from twin.gate.gains import sigmoid_gains, watched
from twin.gate.intervals import Box, UnsupportedOperatorError, enclose
from twin.gate.material import OTHER_STREAMS, GateMaterial
from twin.gate.result import Check, not_shown
from twin.signals.plausible import LARGEST_BEND_DEG

Array = NDArray[np.float64]
PROVEN, TRIED = "bounds for all inputs", "bounds under hostile inputs"
ROUNDING = 1e-5
"""Relative slack of a bound: the graph computes in single precision."""
REACH = "step.reach"
"""Constant of a step's graph that bounds what its policy says, in logarithms."""
_STREAM = OTHER_STREAMS
_STEPS = 100  # samples of a hostile stream
_OF_INPUT = {
    "parts": (0.0, 1.0),
    "variance": (LEAST_VARIANCE, np.inf),
    "sample_time": SAMPLE_TIMES,
    "way_mm": (0.0, np.inf),
}
"""Inputs of a step's graph that are not any number; states may be any, whether or not they can come to be."""
_LARGEST_SENSED = 1e7  # 720 deg in units of the smallest sqrt(R) that a network is told is below it


def proven_bounds(material: GateMaterial) -> Check:
    """Enclose what the policy says, and the outputs, for every input."""
    try:
        import onnx
    except ModuleNotFoundError:
        return not_shown(PROVEN, "the package onnx is not installed (extra rl): the graph cannot be read")
    graph = onnx.load_model_from_string(read_limited(material.path, LARGEST)).graph
    boxes = {part.name: _box_of(part) for part in graph.input}
    try:
        known = enclose(graph, boxes)
    except UnsupportedOperatorError as error:
        return not_shown(PROVEN, f"interval arithmetic does not know the operator {error}")
    wanted = _wanted(material, graph, known)
    if not wanted:
        return not_shown(PROVEN, "nothing tells what a policy of this kind may say")
    rows: list[dict[str, Any]] = [
        {
            "what": what,
            "from": float(box.low.min()),
            "to": float(box.high.max()),
            "bound": f"[{low:g}, {high:g}]",
        }
        for what, box, low, high in wanted
    ]
    excess = max(_excess(box, low, high) for _, box, low, high in wanted)
    holds = excess <= ROUNDING
    said = (
        f"{', '.join(row['what'] for row in rows)}: inside of their bounds for every input"
        if holds
        else next(
            f"{what} is enclosed by [{box.low.min():g}, {box.high.max():g}], wider than [{low:g}, {high:g}]: "
            "it may go beyond its bound, or the enclosure is too wide"
            for what, box, low, high in wanted
            if _excess(box, low, high) > ROUNDING
        )
    )
    return Check(
        PROVEN,
        said,
        figure=float(excess),
        bar=ROUNDING,
        unit="beyond the bound",
        holds=holds or None,  # an enclosure that is too wide shows nothing
        required=False,
        rows=tuple(rows),
        notes=(
            "Interval arithmetic on the deployed graph, inputs and states from minus to plus infinity; "
            "the rounding of single precision is allowed for.",
            "It says nothing of the estimate itself, whose enclosure is unbounded where its inputs are.",
        ),
    )


def _box_of(part: Any) -> Box:
    shape = tuple(axis.dim_value or 1 for axis in part.type.tensor_type.shape.dim)
    low, high = _OF_INPUT.get(part.name, (-np.inf, np.inf))
    return Box(np.full(shape, low), np.full(shape, high))


def _excess(box: Box, low: float, high: float) -> float:
    """Return how far a box goes beyond its bounds, relative to them."""
    scale = max(abs(end) for end in (low, high) if np.isfinite(end))
    above = 0.0 if np.isinf(high) else box.high.max() - high
    return float(max(low - box.low.min(), above, 0.0) / max(scale, 1e-9))


def _wanted(material: GateMaterial, graph: Any, known: dict[str, Box]) -> list[tuple[str, Box, float, float]]:
    """Return what is to be bounded: its name, its enclosure, its lowest and highest value."""
    if isinstance(material.estimator, PolicyEstimator):
        lows, highs = _amounts(material.estimator)
        names = list(material.estimator.make_agent.applied)
        applied = known[graph.output[0].name]
        return [
            (
                name,
                Box(applied.low[:, place], applied.high[:, place]),
                float(lows[place]),
                float(highs[place]),
            )
            for place, name in enumerate(names)
        ]
    wanted = []
    gates = sigmoid_gains(graph)
    for node in graph.node:
        if node.op_type == "Mul" and REACH in node.input:
            reach = float(known[REACH].high.max())
            wanted.append(("what the policy says, in logarithms", known[node.output[0]], -reach, reach))
        if node.op_type == "Sigmoid" and node.output[0] in gates:
            wanted.append(("total gain", known[node.output[0]], 0.0, 1.0))
    if "half_width_deg" in known:
        wanted.append(("half of the interval [deg]", known["half_width_deg"], 1e-9, np.inf))
    return wanted


def _amounts(estimator: PolicyEstimator) -> tuple[Array, Array]:
    """Return the least and the most that a policy may apply."""
    kind: Any = estimator.make_agent
    ends = [kind.amounts(np.full((1, len(kind.applied)), end))[0] for end in (-1.0, 1.0)]
    return np.minimum(*ends), np.maximum(*ends)


def tried_bounds(material: GateMaterial) -> Check:
    """Run the policy on hostile inputs: any number that a faulty sensor, drive or configuration may send."""
    rng = material.random(_STREAM)
    if isinstance(material.estimator, PolicyEstimator):
        return _tried_graph(material, material.estimator, rng)
    return _tried_stream(material, rng)


def _tried_graph(material: GateMaterial, estimator: PolicyEstimator, rng: np.random.Generator) -> Check:
    kind: Any = estimator.make_agent
    shape = (material.size.hostile, len(kind.sensed))
    sensed = rng.standard_normal(shape) * 10 ** rng.uniform(-6, 6, shape)
    ends = np.array([0.0, 1e-38, 1.0, LARGEST_BEND_DEG, _LARGEST_SENSED])
    some = rng.uniform(size=shape) < 0.1
    sensed = np.where(some, rng.choice(np.concatenate([ends, -ends]), shape), sensed)
    applied = estimator.policy(sensed)
    low, high = _amounts(estimator)
    finite = np.isfinite(applied).all()
    beyond = np.maximum(low - applied, applied - high) / np.maximum(np.abs([low, high]).max(axis=0), 1e-9)
    excess = max(float(np.nan_to_num(beyond, nan=np.inf).max()), 0.0)
    return _tried(bool(finite), excess, len(sensed), "what the policy applies")


def _tried_stream(material: GateMaterial, rng: np.random.Generator) -> Check:
    """Run hostile streams side by side: wild measurements and pulls, sensors of any variance."""
    batch = max(material.size.hostile // _STEPS, 1)
    estimator, gains = watched(material.path, material.estimator)
    estimator = estimator.with_sensor(Sensor(10 ** rng.uniform(-4, 4, batch)))
    pulls, measured = _hostile_streams(material.stroke_mm, batch, rng)
    state = estimator.start(pulls[0], rng.uniform(-90, 90, batch))
    narrowest, finite = np.inf, True
    with np.errstate(all="ignore"):
        for k in range(1, _STEPS):
            state = estimator.step(state, pulls[k], pulls[k - 1], measured[k])
            finite &= bool(np.isfinite(estimator.bend_deg(state)).all())
            if estimator.states_interval:
                half = estimator.half_width_deg(state)
                finite &= bool(np.isfinite(half).all())
                narrowest = min(narrowest, float(np.nan_to_num(half, nan=-np.inf).min()))
            material.tell(k / _STEPS)
    excess = 0.0 if narrowest > 0 else 1.0
    what = "estimate and interval"
    if gains is not None:
        low, high = gains.range
        excess = max(excess, -low, high - 1.0)
        what = f"estimate, interval and gain (from {low:.3g} to {high:.3g})"
    return _tried(finite, excess, batch * (_STEPS - 1), what)


def _hostile_streams(
    stroke_mm: tuple[float, float], batch: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return pulls [mm] and measurements [deg] of streams that nothing good sends, both (steps, batch)."""
    low, high = stroke_mm
    width, commands = high - low, 8  # estimators of one command share its twins: more only take longer
    jumps = np.cumsum(rng.normal(0, width / 10, (_STEPS, commands)), axis=0)
    walk = np.clip((low + high) / 2 + jumps, low - width / 2, high + width / 2)
    wild = rng.uniform(-LARGEST_BEND_DEG, LARGEST_BEND_DEG, (_STEPS, batch))
    ends = np.array([LARGEST_BEND_DEG, -LARGEST_BEND_DEG, 0.0, 1e-30, np.nan])
    measured = np.where(rng.uniform(size=wild.shape) < 0.5, wild, rng.choice(ends, wild.shape))
    still = rng.uniform(size=batch) < 0.2  # sensors that say one thing for ever
    measured[:, still] = wild[:1, still]
    return walk[:, np.arange(batch) % commands], measured


def _tried(finite: bool, excess: float, count: int, what: str) -> Check:
    holds = finite and excess <= ROUNDING
    if not finite:
        said = f"what it says is not always a number, under {count} hostile inputs"
    elif holds:
        said = f"{what}: a number and inside of its bounds under each of {count} hostile inputs"
    else:
        said = f"{what}: beyond its bounds under hostile inputs"
    return Check(
        TRIED,
        said,
        figure=excess if np.isfinite(excess) else None,
        bar=ROUNDING,
        unit="beyond the bound",
        holds=holds,
        notes=("Inputs are drawn by chance: what none of them met is not shown.",),
    )
