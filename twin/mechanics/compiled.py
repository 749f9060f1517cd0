"""Compiler of the numerical kernels: Numba where it is installed; else they run as plain Python."""

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

try:
    import numba
except ImportError:  # the same code runs interpreted, a few hundred times slower
    COMPILED = False
else:
    COMPILED = True
"""True where kernels are compiled."""


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel at its first call, and keep the machine code for the next process.

    Numba keeps it by the file of the kernel alone, and would go on with an old copy of another one that this
    one calls. So the folder that it is kept in is named by the source of all of them.
    """
    return _compile(kernel, inline="never")


def inlined(kernel: Kernel) -> Kernel:
    """Compile a kernel into those that call it: for small ones, where a call costs as much as the work."""
    return _compile(kernel, inline="always")


def _compile(kernel: Kernel, inline: Literal["never", "always"]) -> Kernel:
    if not COMPILED:
        return kernel
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, str(cache_folder())
    try:
        made = numba.njit(cache=True, error_model="numpy", nogil=True, inline=inline)(kernel)
    finally:
        settings.CACHE_DIR = before
    return cast(Kernel, made)


@functools.cache
def cache_folder() -> Path:
    """Return the folder for machine code: beside the sources; in the user's cache if they are read-only."""
    here = Path(__file__).parent
    sources = hashlib.sha256()
    for package in ("mechanics", "physics", "reduced"):
        for path in sorted((here.parent / package).glob("*.py")):
            sources.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "endotwin"
    return (
        (here if os.access(here, os.W_OK) else home) / "__pycache__" / f"kernels-{sources.hexdigest()[:16]}"
    )


def has_machine_code(package: str) -> bool:
    """Return whether the kernels of a package need no compiling: the first call then takes no time."""
    return not COMPILED or any(cache_folder().glob(f"{package}_*/*.nbi"))
