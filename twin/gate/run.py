"""The gate: all checks of the table on one policy, and the verdict."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from twin import __version__
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.bounded import sha256_of
from twin.files.shown import cut
from twin.gate.material import WHOLE, GateMaterial
from twin.gate.result import Check, GateVerdict
from twin.gate.table import CHECKS

THOUSANDTHS = 1000
OnProgress = Callable[[int, int, str], None]
"""Told how many of how many thousandths are done, and what is done now."""


def run_gate(material: GateMaterial, on_progress: OnProgress | None = None) -> GateVerdict:
    """Make every check of the table.

    A check that cannot come to its end, as a simulation diverges or the runtime refuses the file, does not
    hold.

    Args:
        material: from `gather`.
        on_progress: told how far it is.
    """
    whole, before = sum(spec.cost for spec in CHECKS), 0.0
    checks = []
    for spec in CHECKS:

        def tell(share: float, begin: float = before, cost: float = spec.cost, name: str = spec.name) -> None:
            if on_progress:
                on_progress(int(THOUSANDTHS * (begin + cost * share) / whole), THOUSANDTHS, name)

        material.tell = tell
        tell(0.0)
        try:
            checks.append(spec.run(material))
        except (DivergedError, InputError) as error:
            checks.append(Check(spec.name, f"it came to no end: {cut(error)}", holds=False))
        before += spec.cost
    if on_progress:
        on_progress(THOUSANDTHS, THOUSANDTHS, "")
    return GateVerdict(tuple(checks), _subject(material))


def write_verdict(verdict: GateVerdict, path: Path, origin: Mapping[str, Any]) -> None:
    """Write `gate.json`, whole or not at all.

    Args:
        verdict: of the gate.
        path: of the file.
        origin: command, versions and hashes of the data.
    """
    values = verdict.to_dict() | {"origin": dict(origin)}
    write_whole(path, json.dumps(values, indent=2, allow_nan=False) + "\n")


def _subject(material: GateMaterial) -> dict[str, object]:
    """Return what was judged, as plain values."""
    return {
        "policy": str(material.path),
        "sha256": sha256_of(material.path),
        "agent": material.file.agent,
        "preset": material.preset.name,
        "stroke_mm": list(material.stroke_mm),
        "sample_time_s": material.sample_time,
        "logs": [
            {"name": log.record.name, "samples": len(log.record.pull_mm), "measured": log.is_measured}
            for log in material.logs
        ],
        "seed": material.seed,
        "quick": material.size != WHOLE,
        "version": __version__,
    }
