"""Inverse of the nominal reduced twin as feed-forward. It asks no sensor."""

from collections.abc import Mapping

import numpy as np

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller
from twin.estimation.registry import Style
from twin.reduced.members import Following, Members, MemberSet


class TwinInverse(Controller):
    """The nominal twin is driven along with the endoscope; each command brings its next bend."""

    def __init__(self, knowledge: ControlKnowledge) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._members = Members(MemberSet.still([knowledge.preset]), knowledge.sample_time)
        self._following: Following

    def _start(self, reference_deg: float) -> None:
        self._following = self._members.start(np.array([self.pull_mm]))

    def _wanted_mm(self, sensed: Sensed) -> float:
        within = self.limits.reach(self.pull_mm, self.sample_time)
        return self._members.common_pull_mm(self._following, np.ones(1), sensed.next_deg, within)

    def _commanded(self) -> None:
        self._following = self._members.step(self._following, np.array([self.pull_mm]))


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> TwinInverse:
    """Return the controller of a run."""
    return TwinInverse(knowledge)


TWIN_INVERSE = register_controller(
    ControllerSpec(
        "twin-inverse",
        2,
        "the nominal reduced twin",
        build,
        style=Style("#4d7f4d", "dashed", ""),
    )
)
