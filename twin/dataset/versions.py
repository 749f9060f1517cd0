"""Versions that the bytes of a dataset depend on besides its recipe."""

from importlib.metadata import version

from twin import __version__

VERSIONS = {"endotwin": __version__, "mujoco": version("mujoco")}
"""Versions by name, as the metadata of an episode and `dataset.json` hold them."""
