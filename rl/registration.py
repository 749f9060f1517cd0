"""Registration of the environments with Gymnasium, which `import rl` does.

`gymnasium.make("rl:EndoTwin/Tracking-v0")` imports it too; Gymnasium has no plug-ins by
entry points since 1.0. An environment is imported when one is made.
"""

import gymnasium

ENVIRONMENT_ID = "EndoTwin/Estimation-v0"
TWINS_ID = "EndoTwin/EstimationTwins-v0"
TRACKING_ID = "EndoTwin/Tracking-v0"


def register_environments() -> None:
    """Make the ids known to Gymnasium."""
    if ENVIRONMENT_ID not in gymnasium.registry:
        vectors = "rl.environment:VectorEstimation"
        gymnasium.register(ENVIRONMENT_ID, "rl.environment:EstimationEnvironment", vector_entry_point=vectors)
        gymnasium.register(TWINS_ID, "rl.environment:EstimationTwinsEnvironment")
        gymnasium.register(TRACKING_ID, "rl.tracking:TrackingEnvironment")


register_environments()
