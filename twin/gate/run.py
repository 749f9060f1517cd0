"""The gate: all checks on one policy, and the verdict."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from twin import __version__
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.bounded import sha256_of
from twin.files.shown import cut
from twin.gate import accuracy, identity, stream, sufficiency
from twin.gate.check import DECLARED, PARTS, Check, CheckSpec, GateVerdict
from twin.gate.evidence import WHOLE, GateMaterial

THOUSANDTHS = 1000
OnProgress = Callable[[int, int, str], None]
"""Called with the number of thousandths that are done, their number, and the running check."""


_MODULES = accuracy, identity, stream, sufficiency  # which declare them
CHECKS = tuple(sorted(DECLARED, key=lambda spec: PARTS.index(spec.part)))
"""All of them, in the order of the argument."""


def run_gate(material: GateMaterial, on_progress: OnProgress | None = None) -> GateVerdict:
    """Make every check of the table on the material from `gather`.

    A check that cannot be completed, as a simulation diverges or the runtime refuses the file, does not hold.
    """
    total, before = sum(spec.cost for spec in CHECKS), 0.0
    checks = []
    for spec in CHECKS:

        def progress(share: float, begin: float = before, of: CheckSpec = spec) -> None:
            if on_progress:
                on_progress(int(THOUSANDTHS * (begin + of.cost * share) / total), THOUSANDTHS, of.name)

        material.on_progress = progress
        progress(0.0)
        try:
            checks.append(spec.run(material))
        except (DivergedError, InputError) as error:
            said = f"it could not be completed: {cut(error)}"
            checks.append(Check(said=said, holds=False, name=spec.name, remedy=spec.remedy))
        before += spec.cost
    if on_progress:
        on_progress(THOUSANDTHS, THOUSANDTHS, "")
    subject = {
        "policy": str(material.path),
        "sha256": sha256_of(material.path),
        "agent": material.file.agent,
        "preset": material.preset.name,
        "stroke_mm": list(material.stroke_mm),
        "sample_time_s": material.sample_time,
        "logs": [
            {"name": log.name, "samples": len(log.time), "measured": log.is_measured} for log in material.logs
        ],
        "seed": material.seed,
        "quick": material.size != WHOLE,
        "version": __version__,
    }
    return GateVerdict(checks=tuple(checks), subject=subject)


def write_verdict(verdict: GateVerdict, path: Path, origin: Mapping[str, Any]) -> None:
    """Write `gate.json` with its origin (command, versions, hashes of the data), completely or not at all."""
    values = verdict.to_dict() | {"origin": dict(origin)}
    write_whole(path, json.dumps(values, indent=2, allow_nan=False) + "\n")
