"""A file of RAM (twins) that nothing was taught to: a filter on a few still twins; no policy acts."""

import fcntl
from pathlib import Path

from controlled import DEPLOYMENT, R
from small_twins import LAWS, TINY, normal_laws, small_step, still_members

from rl.twins.graph import export_twins
from twin.estimation.deployment import KEY
from twin.reduced.member_set import members_to_dict

OFF_DEG = (-16.0, 18.0)
"""Means of a sensor that is off, each of which its law takes for what it is."""


def shared(folder: Path) -> Path:
    """Export into a folder, or take what another process of these tests has exported there."""
    folder.mkdir(exist_ok=True)
    path = folder / "policy.onnx"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.is_file():
            described = {"members": members_to_dict(still_members()), KEY: DEPLOYMENT.to_dict()}
            means = [0.0] * (LAWS - len(OFF_DEG)) + [off / R**0.5 for off in OFF_DEG]
            step = normal_laws(small_step(), means)
            export_twins(step, TINY.members, {"agent": "ram-twins"} | described, path)
    return path
