"""Interactive view: a twin that is driven by hand or a recording that is played, as poses and curves."""

from twin.view.session import Columns, Inputs, LiveTwin, Playback, Pose, Session

__all__ = ["Columns", "Inputs", "LiveTwin", "Playback", "Pose", "Session"]
