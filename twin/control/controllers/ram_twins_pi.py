"""Linear map and PI on the estimate of RAM (twins): what the estimate alone earns, without an inverse."""

import functools
from collections.abc import Mapping

from twin.control.feedback import PI_SETTINGS, EstimateFeedback
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller
from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import load
from twin.estimation.registry import Style
from twin.live.online import OnlineEstimator


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> EstimateFeedback:
    """Return the controller of a run."""
    told = load(knowledge.trained).at(knowledge.sample_time).with_sensor(Sensor(knowledge.noise_variance))
    make_estimator = functools.partial(OnlineEstimator, told, knowledge.sample_time)
    return EstimateFeedback(knowledge, make_estimator, settings)


RAM_TWINS_PI = register_controller(
    ControllerSpec(
        "ram-twins-pi",
        5,
        "estimate of RAM (twins)",
        build,
        PI_SETTINGS,
        needs="policy",
        style=Style("#c77cb0", "dashed", ""),
    )
)
