"""What the bytes of a dataset depend on besides its recipe."""

from importlib.metadata import version

from twin import __version__

VERSIONS = {"endotwin": __version__, "mujoco": version("mujoco")}
"""Versions of what makes an episode, as its metadata holds them."""
