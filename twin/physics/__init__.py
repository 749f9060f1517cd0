"""MuJoCo simulation of the endoscope: model, readings, friction, drive, single and batch runs."""

import ctypes.util
import os


def choose_backend() -> str:
    """Return the name of a headless OpenGL backend of which the system has the library, or `disable`."""
    for backend, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if ctypes.util.find_library(library):
            return backend
    return "disable"


os.environ.setdefault("MUJOCO_GL", choose_backend())  # dm_control, imported below, binds to it

from twin.physics.endoscope import Endoscope  # noqa: E402
from twin.physics.model import model_xml  # noqa: E402
from twin.physics.simulation import MUJOCO, simulate, simulate_batch  # noqa: E402
from twin.physics.stepping import State  # noqa: E402

__all__ = ["MUJOCO", "Endoscope", "State", "model_xml", "simulate", "simulate_batch"]
