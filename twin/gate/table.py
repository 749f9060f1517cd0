"""The table of checks: every check of the gate, declared once, in the order in which it is made."""

import dataclasses
from collections.abc import Callable

from twin.gate.checks import accuracy, bounds, faults, honesty, identity, latency, sufficiency
from twin.gate.material import GateMaterial
from twin.gate.result import Check


@dataclasses.dataclass(frozen=True)
class CheckSpec:
    """Declaration of one check.

    Attributes:
        name: of it.
        claim: what a go claims by it.
        question: what it asks.
        part: part of the argument that it belongs to.
        run: makes it.
        cost: share of the gate's time, relative to the others.
    """

    name: str
    claim: str
    question: str
    part: str
    run: Callable[[GateMaterial], Check]
    cost: float = 1.0


IDENTITY, TWIN, ACCURACY, HONESTY, SAFETY = (
    "Identity of the policy",
    "Relevance of the twin",
    "Accuracy",
    "Honesty of what it says of itself",
    "Safety of its running",
)
PARTS = {
    IDENTITY: "What is deployed is what was trained, for this endoscope.",
    TWIN: "Evidence on simulated twins says something of the real endoscope.",
    ACCURACY: "The policy is not worse than the filter that would run without it.",
    HONESTY: "Who relies on the stated interval is not misled.",
    SAFETY: "Whatever comes, the estimate stays a number within bounds, in time.",
}
"""Parts of the argument and the claim of each."""

CHECKS = (
    CheckSpec(
        identity.ENDOSCOPE,
        "The policy was trained for this endoscope.",
        "Is every parameter of the preset as in the training, or within its ranges?",
        IDENTITY,
        identity.made_for_endoscope,
    ),
    CheckSpec(
        identity.CONFIGURED,
        "The file is of the run that its folder tells of.",
        "Does the file say the same as the config.yaml beside it?",
        IDENTITY,
        identity.configured,
    ),
    CheckSpec(
        identity.FAITHFUL,
        "The graph is the network that was trained.",
        "Does it say of reference steps what the trained network said of them?",
        IDENTITY,
        identity.faithful,
    ),
    CheckSpec(
        bounds.PROVEN,
        "Gains are within their bounds for every input.",
        "What does interval arithmetic through the graph enclose?",
        SAFETY,
        bounds.proven_bounds,
    ),
    CheckSpec(
        bounds.TRIED,
        "Hostile inputs lead to no wild output.",
        "What does the policy say under extreme and random inputs?",
        SAFETY,
        bounds.tried_bounds,
        8,
    ),
    CheckSpec(
        accuracy.ON_TWINS,
        "On endoscopes of this kind the policy is not worse than the trusted filter.",
        "How large are their paired errors on twins that no training has seen?",
        ACCURACY,
        accuracy.on_held_out_twins,
        35,
    ),
    CheckSpec(
        accuracy.ON_WIDER,
        "Nor on endoscopes that differ more than the ranges say.",
        "The same on twins from ranges half as wide again.",
        ACCURACY,
        accuracy.on_wider_twins,
        25,
    ),
    CheckSpec(
        accuracy.LEARNING,
        "What was learned is worth its risk.",
        "Is the policy better than its own filter without what was learned?",
        ACCURACY,
        accuracy.learning_helps,
        13,
    ),
    CheckSpec(
        accuracy.ON_LOGS,
        "On the logs of this endoscope it is not worse either.",
        "How large are their paired errors on the logs, with noise drawn on their angles?",
        ACCURACY,
        accuracy.on_logs,
        10,
    ),
    CheckSpec(
        sufficiency.SUFFICIENT,
        "The preset's twin is a picture of this endoscope.",
        "How well does the twin, driven by their commands alone, predict the logs?",
        TWIN,
        sufficiency.twin_of_logs,
        2,
    ),
    CheckSpec(
        honesty.COVERAGE,
        "The stated 95 % interval holds the truth as often as it should.",
        "How often does it, under each noise?",
        HONESTY,
        honesty.coverage,
    ),
    CheckSpec(
        honesty.NEES,
        "Errors are as large as the interval states.",
        "What is the normalised estimation error squared?",
        HONESTY,
        honesty.nees,
    ),
    CheckSpec(
        honesty.NIS,
        "Innovations are as large as prediction and sensor state.",
        "What is the normalised innovation squared?",
        HONESTY,
        honesty.nis,
        4,
    ),
    CheckSpec(
        faults.FINITE,
        "No fault of a stream makes it say something that is no number.",
        "Is every estimate a number while faults are planted?",
        SAFETY,
        faults.no_nan,
        12,
    ),
    CheckSpec(
        faults.FLAGGED,
        "A fault of a stream is noticed.",
        "Does the runtime say so while it lasts?",
        SAFETY,
        faults.flagged,
    ),
    CheckSpec(
        faults.ERRORS,
        "A fault costs no more than it would cost the trusted filter.",
        "How large are the errors while it lasts, and the fallback's alone?",
        SAFETY,
        faults.errors,
    ),
    CheckSpec(
        latency.LATENCY,
        "An estimate is there long before the next sample.",
        "How long does one sample take here?",
        SAFETY,
        latency.latency,
        3,
    ),
)
"""All of them."""
