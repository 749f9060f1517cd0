"""Registration of the environments with Gymnasium, which finds it by the entry point `gymnasium.envs`."""

ENVIRONMENT_ID = "EndoTwin/Estimation-v0"


def register_environments() -> None:
    """Make `ENVIRONMENT_ID` known to Gymnasium; it imports the environment when one is made."""
    import gymnasium

    if ENVIRONMENT_ID not in gymnasium.registry:
        gymnasium.register(ENVIRONMENT_ID, entry_point="rl.environment:EstimationEnvironment")
