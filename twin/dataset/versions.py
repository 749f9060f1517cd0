"""What the bytes of a dataset depend on besides its recipe."""

from twin import __version__
from twin.physics import MUJOCO

VERSIONS = {"endotwin": __version__, "mujoco": MUJOCO}
"""Versions of what makes an episode, as its metadata holds them."""
