"""Identity: the policy was made for this endoscope, and the file is what the training left."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.estimation.learned.reference import REFERENCE, replay
from twin.files.run_folder import CONFIGURATION_FILE
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml
from twin.gate.material import GateMaterial
from twin.gate.result import Check, none_of, not_shown
from twin.preset.preset import Preset

ENDOSCOPE, CONFIGURED, FAITHFUL = (
    "made for this endoscope",
    "file and run folder agree",
    "graph as it was trained",
)
FREE = ("name", "time_step", "sensor_noise", "sensor_resolution", "sensor_period", "sensor_latency")
"""Parameters that a policy is not made for: name, solver's step, and the sensor, whose R it is told."""
CLOSE = 1e-6  # relative difference of two parameters that are the same
REPLAYED_DEG = 1e-5
"""Largest difference between the graph and the network that was trained, relative above 1 deg."""


def made_for_endoscope(material: GateMaterial) -> Check:
    """Compare the preset in the file with the one that it is to run on."""
    told = material.file.description.get("preset")
    if not isinstance(told, Mapping):
        return not_shown(ENDOSCOPE, "the file does not tell the endoscope that it was trained for")
    rows = differing_parameters(told, material.file.description.get("ranges"), material.preset)
    name = cut(str(told.get("name", "")), 40)
    first = ", ".join(row["parameter"] for row in rows[:3]) + (" ..." if len(rows) > 3 else "")
    return none_of(
        ENDOSCOPE,
        rows,
        f"trained for {name!r}, and every parameter of {material.preset.name!r} is as there or in its ranges",
        f"it was trained for {name!r}: {len(rows)} parameters of {material.preset.name!r} are others, "
        f"outside of the ranges of its training: {first}",
        "parameters",
        rows=rows,
        notes=("Names, the solver's step and the sensor may differ.",),
    )


def differing_parameters(told: Mapping[str, Any], ranges: Any, preset: Preset) -> list[dict[str, Any]]:
    """Return the parameters of a preset that a training knew neither as they are nor within its ranges.

    Args:
        told: the preset of the training.
        ranges: of the training: lowest and highest value by name.
        preset: the other one.
    """
    limits = ranges if isinstance(ranges, Mapping) else {}
    rows: list[dict[str, Any]] = []
    for name, value in preset.to_dict().items():
        if name in FREE or not isinstance(value, int | float):
            continue
        trained = told.get(name, getattr(Preset, name, None))
        low, high = trained, trained
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


def configured(material: GateMaterial) -> Check:
    """Compare what the file says of its training with the `config.yaml` beside it."""
    path = material.path.parent / CONFIGURATION_FILE
    if not path.is_file():
        return not_shown(CONFIGURED, f"there is no {CONFIGURATION_FILE} beside the file")
    try:
        values = read_yaml(path)
    except ValueError as error:
        return Check(CONFIGURED, cut(str(error), 150), holds=False, unit="entries", bar=0.0, relation="equal")
    if not isinstance(values, Mapping) or not values:
        return not_shown(CONFIGURED, f"{CONFIGURATION_FILE} beside the file holds no configuration")
    told = material.file.description
    rows = [
        {"entry": name, "file": "differs" if name in told else "is missing"}
        for name, value in values.items()
        if _plain(told.get(name)) != _plain(value)
    ]
    return none_of(
        CONFIGURED,
        rows,
        f"the {len(values)} entries of {CONFIGURATION_FILE} are in the file, word for word",
        f"the file was not made by the run of its folder: {', '.join(row['entry'] for row in rows)}",
        "entries",
        rows=rows,
    )


def _plain(value: Any) -> Any:
    return json.loads(json.dumps(value, default=str))


def faithful(material: GateMaterial) -> Check:
    """Replay the reference steps that the training computed, and compare."""
    if REFERENCE not in material.file.description:
        return not_shown(FAITHFUL, "the file holds no reference steps: an earlier version wrote it")
    try:
        differences = replay(material.file)
    except InputError as error:
        return Check(FAITHFUL, cut(str(error), 150), bar=REPLAYED_DEG, holds=False)
    worst = float(np.nan_to_num(max(differences.values()), nan=np.inf))
    holds = worst <= REPLAYED_DEG
    name = max(differences, key=lambda of: differences[of])
    return Check(
        FAITHFUL,
        f"it says of the reference steps what the trained network said, within {worst:.1e}"
        if holds
        else f"the graph is not the network that was trained: {name} differs by {worst:.2g} on the reference "
        "steps: was it changed or damaged?",
        figure=worst if np.isfinite(worst) else None,
        bar=REPLAYED_DEG,
        unit="deg, relative above 1 deg",
        holds=holds,
        rows=tuple({"output": of, "difference": value} for of, value in differences.items()),
        notes=("A check of integrity, not of security: who changes the graph can change these steps.",),
    )
