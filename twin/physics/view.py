"""Side view of the endoscope, rendered by MuJoCo without a screen."""

import os

import numpy as np
from dm_control import mujoco as dm_mujoco
from numpy.typing import NDArray

from twin.physics.endoscope import Endoscope
from twin.physics.headless import HOW_TO_INSTALL


class SideView:
    """Camera that looks along y, at right angles to the bending plane."""

    def __init__(
        self, endoscope: Endoscope, centre: NDArray[np.float64], half_height: float, width: int, height: int
    ) -> None:
        """Place the camera and render once, so that a missing library is reported at the start.

        Args:
            endoscope: the endoscope, drawn in its pose at the time of the picture.
            centre: (2,) what the camera looks at, as (x, z) [m].
            half_height: of what is seen there [m].
            width: of a picture [pixels].
            height: of a picture [pixels].

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
        if os.environ.get("MUJOCO_GL", "").lower() in ("disable", "disabled", "off", "false", "0"):
            raise OSError(f"nothing here can draw without a screen (MUJOCO_GL=disable): {HOW_TO_INSTALL}")
        distance = half_height / np.tan(np.radians(endoscope.model.vis.global_.fovy) / 2)
        try:
            self._camera = dm_mujoco.MovableCamera(endoscope, height=height, width=width)
            self._camera.set_pose([centre[0], 0, centre[1]], distance, azimuth=90, elevation=0)
            self._camera.render()
        except (ImportError, RuntimeError, AttributeError) as error:
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise OSError(f"nothing here can draw without a screen ({cause}): {HOW_TO_INSTALL}") from error

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture of the endoscope as it is now, on white, (height, width, 3)."""
        picture: NDArray[np.uint8] = self._camera.render().copy()  # the camera draws into one buffer
        return picture
