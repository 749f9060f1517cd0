"""Versions that the bytes of a dataset depend on besides its recipe."""

from twin import __version__
from twin.physics import MUJOCO

VERSIONS = {"endotwin": __version__, "mujoco": MUJOCO}
"""Versions by name, as the metadata of an episode and `dataset.json` hold them."""
