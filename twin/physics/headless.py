"""Choice of MuJoCo's headless OpenGL backend; must be imported before dm_control, which binds to it."""

import ctypes.util
import os

HOW_TO_INSTALL = (
    "install libegl1 and libgl1-mesa-dri, or libosmesa6 (apt-get install libegl1 libgl1-mesa-dri)"
)


def choose_backend() -> str:
    """Return the name of a headless backend of which the system has the library, or `disable`."""
    for backend, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if ctypes.util.find_library(library):
            return backend
    return "disable"


os.environ.setdefault("MUJOCO_GL", choose_backend())
