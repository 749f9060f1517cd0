"""Portrait of an endoscope while it is simulated, by either twin: only the hinge angles are read."""

import numpy as np
from numpy.typing import NDArray

from twin.physics.endoscope import Endoscope
from twin.physics.view import SideView
from twin.preset.preset import Preset

SIZE = 480
"""Width and height of a picture [pixels]."""
_AHEAD, _HALF_HEIGHT = 0.35, 0.9
"""Centre of the view in front of the base, and half its height, in lengths of the section.

They hold every arc of constant curvature, whose tip goes from -0.22 to 1 lengths ahead and 0.73 to a side.
"""


class Portrait:
    """Drawn double of a simulated endoscope, posed as that one stands; the simulation is not touched."""

    def __init__(self, preset: Preset) -> None:
        """Build the double and place the camera.

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
        self._double = Endoscope.from_preset(preset)
        length = preset.section_length
        centre = np.array([_AHEAD * length, 0.0])
        self._view = SideView(self._double, centre, _HALF_HEIGHT * length, SIZE, SIZE)

    def picture(self, joint_angle: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return a picture on white, (`SIZE`, `SIZE`, 3), at hinge angles (vertebrae,) [rad]."""
        self._double.set_pose(joint_angle)
        return self._view.picture()
