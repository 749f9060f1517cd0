"""Exceptions that the library raises for its users; each is also the built-in exception that it refines."""

import contextlib
import importlib.util
from collections.abc import Iterator


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


EXTRAS = {
    "sim": ("mujoco", "numba", "dm_control", "OpenGL", "pymoo"),
    "rl": ("torch", "stable_baselines3", "gymnasium", "onnx", "onnxscript"),
    "viz": ("matplotlib", "av", "PIL", "jinja2", "markupsafe"),
    "cluster": ("distributed",),
    "parquet": ("pyarrow",),
    "logs": ("rosbags", "openpyxl"),
    "tensorboard": ("tensorboard",),
    "live": ("websockets",),
    "view": ("viser", "trimesh"),
    "benchmark": ("filterpy",),
    "vision": ("cv2",),
    "notebook": ("pandas",),
}
"""Extras of EndoTwin, and the modules that each installs, by the names that they are imported by."""


def missing_extra(error: ImportError, what: str = "this") -> MissingExtraError | None:
    """Return an error that names the extra to install for `what`; None if the module belongs to no extra."""
    for extra, modules in EXTRAS.items():
        if isinstance(error, ModuleNotFoundError) and error.name in modules:
            return _not_installed(extra, error.name, what)
    return None


@contextlib.contextmanager
def needs_extra(what: str) -> Iterator[None]:
    """Name the extra to install for `what`, where a module that is imported in this context is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise missing_extra(error, what) or error from None


def require_extra(extra: str, what: str = "this") -> None:
    """Refuse to begin `what` needs an extra that is not installed, before any work."""
    for module in EXTRAS[extra]:
        if importlib.util.find_spec(module) is None:
            raise _not_installed(extra, module, what)


def _not_installed(extra: str, module: str, what: str) -> MissingExtraError:
    install = f"pip install 'endotwin[{extra}]'"
    return MissingExtraError(f"{what} needs {module}: {install}", name=module)
