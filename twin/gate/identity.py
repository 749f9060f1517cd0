"""Identity and bounds: the file is that of the training, for this endoscope; its outputs are bounded."""

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.estimator import Sensor
from twin.estimation.learned.reference import REFERENCE, replay
from twin.estimation.learned.trained_file import LARGEST
from twin.files.bounded import read_limited
from twin.files.run_folder import CONFIGURATION_FILE
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml
from twin.gate.check import IDENTITY, NOTHING, SAFETY, Check, declare, none_of, not_shown
from twin.gate.evidence import OTHER_STREAMS, GateMaterial, Stroke
from twin.preset.preset import Preset
from twin.signals.sensor import LARGEST_BEND_DEG

Array = NDArray[np.float64]
FREE = ("name", "time_step", *(field.name for field in dataclasses.fields(Preset) if "sensor" in field.name))
"""Parameters that a policy is not made for: name, solver's step, and the sensor, which it is given."""
CLOSE = 1e-6  # relative difference of two parameters that are the same
REPLAYED_DEG = 1e-5
"""Largest difference between the graph and the network that was trained, relative above 1 deg."""
REACH = "step.reach"  # constant of a step's graph that bounds the output of its policy, in logarithms
LARGEST_ESTIMATE_DEG = 10 * LARGEST_BEND_DEG
"""Magnitude that no estimate exceeds for any input; the live path refuses larger ones [deg]."""
DAMAGED = "Do not deploy this file; train again with this version."
WITH_FOLDER = "Judge the file in its run folder."
_STREAM = OTHER_STREAMS
_STEPS = 100  # samples of a hostile stream


@declare("made for this endoscope", IDENTITY, "Train for this preset, or give the preset of the training.")
def made_for_endoscope(material: GateMaterial) -> Check:
    """The policy was trained for this endoscope."""
    trained = material.file.description.get("preset")
    if not isinstance(trained, Mapping):
        return not_shown("the file does not contain the endoscope that it was trained for", NOTHING)
    rows = differing_parameters(trained, material.file.description.get("ranges"), material.preset)
    name, here = cut(str(trained.get("name", "")), 40), material.preset.name
    first = ", ".join(row["parameter"] for row in rows[:3]) + (" ..." if len(rows) > 3 else "")
    return none_of(
        rows,
        f"trained for {name!r}, and every parameter of {here!r} is as there or in its ranges",
        f"it was trained for {name!r}: {len(rows)} parameters of {here!r} are outside of the ranges of its "
        f"training: {first}",
        "parameters",
        rows=tuple(rows),
        notes=("Names, the solver's step and the sensor may differ.",),
    )


def differing_parameters(trained: Mapping[str, Any], ranges: Any, preset: Preset) -> list[dict[str, Any]]:
    """Return the parameters of a preset that differ from the trained ones beyond their ranges."""
    limits = ranges if isinstance(ranges, Mapping) else {}
    rows: list[dict[str, Any]] = []
    for name, value in preset.to_dict().items():
        if name in FREE or not isinstance(value, int | float):
            continue
        low = high = trained.get(name, getattr(Preset, name, None))
        pair = limits.get(name)
        if isinstance(pair, list | tuple) and len(pair) == 2:
            low, high = pair
        if not (isinstance(low, int | float) and isinstance(high, int | float)):
            rows.append({"parameter": name, "here": value, "trained": None})
            continue
        slack = CLOSE * max(abs(low), abs(high), abs(value))
        if not low - slack <= value <= high + slack:
            rows.append({"parameter": name, "here": value, "trained": [low, high] if low != high else low})
    return rows


@declare("file and run folder agree", IDENTITY, "Take the file and its folder from the same training run.")
def configured(material: GateMaterial) -> Check:
    """The file is of the run of its folder."""
    path = material.path.parent / CONFIGURATION_FILE
    if not path.is_file():
        return not_shown(f"there is no {CONFIGURATION_FILE} next to the file", WITH_FOLDER)
    try:
        values = read_yaml(path)
    except ValueError as error:
        return Check(said=cut(str(error), 150), bar=0.0, relation="equal", unit="entries", holds=False)
    if not isinstance(values, Mapping) or not values:
        return not_shown(f"{CONFIGURATION_FILE} next to the file has no configuration", WITH_FOLDER)
    in_file = {"agent": material.file.agent, **material.file.description}
    rows = [
        {"entry": name, "file": "differs" if name in in_file else "is missing"}
        for name, value in values.items()
        if json.dumps(in_file.get(name), default=str) != json.dumps(value, default=str)
    ]
    return none_of(
        rows,
        f"the {len(values)} entries of {CONFIGURATION_FILE} are in the file, word for word",
        f"the file was not made by the run of its folder: {', '.join(row['entry'] for row in rows)}",
        "entries",
        rows=tuple(rows),
    )


@declare("graph as it was trained", IDENTITY, "Copy the file again from its run folder, or train again.")
def faithful(material: GateMaterial) -> Check:
    """The graph is the network that was trained."""
    if REFERENCE not in material.file.description:
        return not_shown(
            "the file has no reference steps: an earlier version wrote it", "Train again with this version."
        )
    try:
        differences = replay(material.file)
    except InputError as error:
        return Check(said=cut(str(error), 150), bar=REPLAYED_DEG, holds=False)
    worst = float(np.nan_to_num(max(differences.values()), nan=np.inf))
    holds = worst <= REPLAYED_DEG
    name = max(differences, key=lambda of: differences[of])
    return Check(
        said=f"it returns of the reference steps what the trained network returned, within {worst:.1e}"
        if holds
        else f"the graph is not the network that was trained: {name} differs by {worst:.2g} on the reference "
        "steps: was it changed or damaged?",
        figure=worst if np.isfinite(worst) else None,
        bar=REPLAYED_DEG,
        unit="deg, relative above 1 deg",
        holds=holds,
        rows=tuple({"output": of, "difference": value} for of, value in differences.items()),
        notes=("A check of integrity, not of security: these steps can be changed with the graph.",),
    )


@declare("bounds for all inputs", SAFETY, DAMAGED)
def proven_bounds(material: GateMaterial) -> Check:
    """Gains and actions are within their bounds for every input."""
    try:
        import onnx
    except ModuleNotFoundError:
        return not_shown(
            "the package onnx is not installed: the graph cannot be read", "pip install 'endotwin[rl]'"
        )
    graph = onnx.load_model_from_string(read_limited(material.path, LARGEST)).graph
    rows = bounds_by_construction(graph)
    if not rows:
        return not_shown("no operator of the graph bounds what a policy may do", NOTHING)
    unbounded = [row for row in rows if not row["bounded"]]
    what = ", ".join(dict.fromkeys(f"{row['what']} [{row['from']:g}, {row['to']:g}]" for row in rows))
    return none_of(
        unbounded,
        f"bounded by construction for every input: {what}",
        f"not bounded by construction: {', '.join(row['what'] for row in unbounded)}",
        "bounds missing",
        rows=tuple(rows),
        notes=("By the operators of the deployed graph; nothing follows for the estimate itself.",),
        required=False,
    )


def bounds_by_construction(graph: Any) -> list[dict[str, Any]]:
    """Return the bounds that the operators of a graph set, by what they bound.

    An action of PPO is bounded by a Clip to [-1, 1], the output of a policy by its reach times a Tanh, and a
    gain by a Sigmoid of the log of a ratio, to which the output of a policy may be added.
    """
    from onnx import numpy_helper

    constants = {part.name: numpy_helper.to_array(part) for part in graph.initializer}
    maker = {name: node for node in graph.node for name in node.output}
    constants |= {
        name: numpy_helper.to_array(node.attribute[0].t)
        for name, node in maker.items()
        if node.op_type == "Constant" and node.attribute[0].name == "value"
    }

    def made_by(name: str, operator: str) -> bool:
        return name in maker and maker[name].op_type == operator

    def inputs_of(name: str) -> list[str]:
        return list(maker[name].input) if made_by(name, "Add") else []

    rows: list[dict[str, Any]] = []
    for node in graph.node:
        ends = [constants[name] for name in node.input[1:] if name in constants]
        if node.op_type == "Clip" and [float(end) for end in ends] == [-1, 1]:
            rows.append(_bound("action of the policy", -1.0, 1.0))
        elif node.op_type == "Mul" and REACH in node.input:
            reach = float(np.abs(constants[REACH]).max())
            bounded = any(made_by(name, "Tanh") for name in node.input)
            rows.append(_bound("output of the policy, in logarithms", -reach, reach, bounded=bounded))
        elif node.op_type == "Sigmoid" and any(
            made_by(of, "Log") for of in (node.input[0], *inputs_of(node.input[0]))
        ):
            rows.append(_bound("total gain", 0.0, 1.0))
    return rows


def _bound(what: str, low: float, high: float, *, bounded: bool = True) -> dict[str, Any]:
    return {"what": what, "from": low, "to": high, "bounded": bounded}


@declare("bounds under hostile inputs", SAFETY, DAMAGED, 8)
def tried_bounds(material: GateMaterial) -> Check:
    """Hostile inputs lead to no wild output.

    Any number comes that a faulty sensor, drive or configuration may send.
    """
    rng = material.random(_STREAM)
    batch = max(material.size.hostile // _STEPS, 1)
    estimator = material.estimator.with_sensor(Sensor(10 ** rng.uniform(-4, 4, batch)))
    pulls, measured = _hostile_streams(material.stroke_mm, batch, rng)
    state = estimator.start(pulls[0], rng.uniform(-90, 90, batch))
    largest, narrowest = 0.0, np.inf
    with np.errstate(all="ignore"):
        for k in range(1, _STEPS):
            state = estimator.step(state, pulls[k], pulls[k - 1], measured[k])
            bend = np.abs(estimator.bend_deg(state))
            largest = max(largest, float(np.nan_to_num(bend, nan=np.inf).max()))
            if estimator.states_interval:
                half = estimator.half_width_deg(state)
                half = np.where(np.isfinite(half), half, -np.inf)
                narrowest = min(narrowest, float(half.min()))
            material.on_progress(k / _STEPS)
    count = batch * (_STEPS - 1)
    holds = largest <= LARGEST_ESTIMATE_DEG and narrowest > 0
    return Check(
        said=f"estimate and interval are numbers within their bounds under each of {count} hostile inputs"
        if holds
        else f"estimate or interval is beyond its bounds, or not a number, under {count} hostile inputs",
        figure=largest if np.isfinite(largest) else None,
        bar=LARGEST_ESTIMATE_DEG,
        unit="deg, largest estimate",
        holds=holds,
        notes=("Inputs are drawn: what none of them met is not shown.",),
    )


def _hostile_streams(stroke_mm: Stroke, batch: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return pulls [mm] and measurements [deg] of hostile streams, both (steps, batch)."""
    low, high = stroke_mm
    width, commands = high - low, 8  # estimators of one command share its twins: more only take longer
    jumps = np.cumsum(rng.normal(0, width / 10, (_STEPS, commands)), axis=0)
    walk = np.clip((low + high) / 2 + jumps, low - width / 2, high + width / 2)
    wild = rng.uniform(-LARGEST_BEND_DEG, LARGEST_BEND_DEG, (_STEPS, batch))
    ends = np.array([LARGEST_BEND_DEG, -LARGEST_BEND_DEG, 0.0, 1e-30, np.nan])
    measured = np.where(rng.uniform(size=wild.shape) < 0.5, wild, rng.choice(ends, wild.shape))
    still = rng.uniform(size=batch) < 0.2  # sensors that repeat one number
    measured[:, still] = wild[:1, still]
    return walk[:, np.arange(batch) % commands], measured
