"""Registration of the environments with Gymnasium, when this module is imported.

Gymnasium imports the module that stands before an id, as in
`gymnasium.make("rl.registration:EndoTwin/Tracking-v0")`; its plug-ins by entry points ended with 1.0.
An environment is imported when one is made.
"""

import gymnasium

ENVIRONMENT_ID = "EndoTwin/Estimation-v0"
TRACKING_ID = "EndoTwin/Tracking-v0"
_ENTRY_POINTS = {
    ENVIRONMENT_ID: "rl.environment:EstimationEnvironment",
    TRACKING_ID: "rl.tracking:TrackingEnvironment",
}


def register_environments() -> None:
    """Make the ids known to Gymnasium."""
    for name, entry_point in _ENTRY_POINTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=entry_point)


register_environments()
