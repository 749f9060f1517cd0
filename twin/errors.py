"""Exceptions that the library raises for its users; each is also the built-in exception that it refines."""

import importlib.util


class EndoTwinError(Exception):
    """Base class of all exceptions below: a user's mistake, in one line."""


class InputError(EndoTwinError, ValueError):
    """An invalid value, file content or combination of options."""


class MissingFileError(EndoTwinError, FileNotFoundError):
    """A file or folder that does not exist."""


class DivergedError(EndoTwinError, FloatingPointError):
    """A simulation or an estimate that left all bounds."""


class MissingExtraError(EndoTwinError, ImportError):
    """A package of an extra of EndoTwin that is not installed."""


EXTRA_OF = {
    "mujoco": "sim",
    "numba": "sim",
    "dm_control": "sim",
    "OpenGL": "sim",
    "pymoo": "sim",
    "torch": "rl",
    "stable_baselines3": "rl",
    "gymnasium": "rl",
    "onnx": "rl",
    "onnxscript": "rl",
    "matplotlib": "viz",
    "av": "viz",
    "PIL": "viz",
    "jinja2": "viz",
    "markupsafe": "viz",
    "distributed": "cluster",
    "pyarrow": "parquet",
    "tensorboard": "tensorboard",
    "foxglove": "live",
    "filterpy": "benchmark",
    "cv2": "vision",
}
"""Extra of EndoTwin that installs a module, by the name that the module is imported by."""


def missing_extra(error: ImportError, what: str = "this") -> MissingExtraError | None:
    """Return an error that names the extra to install for `what`; None if the module belongs to no extra."""
    is_missing = isinstance(error, ModuleNotFoundError) and error.name in EXTRA_OF
    return _not_installed(str(error.name), what) if is_missing else None


def require_extra(extra: str, what: str = "this") -> None:
    """Refuse to begin `what` needs an extra that is not installed, before any work."""
    for module, its_extra in EXTRA_OF.items():
        if its_extra == extra and importlib.util.find_spec(module) is None:
            raise _not_installed(module, what)


def _not_installed(module: str, what: str) -> MissingExtraError:
    install = f"pip install 'endotwin[{EXTRA_OF[module]}]'"
    return MissingExtraError(f"{what} needs {module}: {install}", name=module)
