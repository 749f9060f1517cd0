"""Linear map: the pull that would bring the reference if there were no hysteresis. It asks no sensor."""

from collections.abc import Mapping

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.line import Line
from twin.control.registry import ControllerSpec, register_controller
from twin.estimation.registry import Style


class LinearMap(Controller):
    """The nominal twin's line, without feedback."""

    def __init__(self, line: Line, knowledge: ControlKnowledge) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.line = line

    def _wanted_mm(self, sensed: Sensed) -> float:
        return self.line.pull_mm(sensed.next_deg)


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> LinearMap:
    """Return the controller of a run."""
    return LinearMap(knowledge.line, knowledge)


LINEAR = register_controller(
    ControllerSpec(
        "linear", 0, "nothing but the line of the nominal twin", build, style=Style("#9a9a9a", "dotted", "")
    )
)
