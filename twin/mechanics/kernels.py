"""Kernels: functions of numbers and arrays, compiled by Numba where it is installed, otherwise run by Python.

Kernels call each other; an `entry` is one that the rest of the program calls, outside of the GIL. Its machine
code, with all kernels that it calls inside, is kept in a folder that is named after a hash of the sources of
all kernels: Numba looks at the file of the entry only, and would run stale code after an edit of another one.

Kernels make no arrays, but views: no references are counted, which would take an atomic operation for each
array that is handed on. What compiles takes the time of Numba for each function and each statement, and that
of LLVM once, for the entry with all that it calls (`compiler.py`).
"""

import contextlib
import functools
import hashlib
import importlib.util
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

from numpy.typing import NDArray

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# Where kernels are not compiled, the same code runs interpreted, a few hundred times slower.
DISABLED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")  # by the user, as for a debugger
COMPILED = importlib.util.find_spec("numba") is not None and not DISABLED
PACKAGES = ("mechanics", "physics", "reduced")  # that have kernels


def kernel(function: Kernel) -> Kernel:
    """Compile a function that other kernels call; Python cannot call it, but where nothing is compiled."""
    if not COMPILED:
        return function
    from twin.mechanics.compiler import compile_part

    return cast(Kernel, compile_part(function))


def entry(function: Kernel) -> Kernel:
    """Compile a function that the rest of the program calls, and keep its machine code.

    It takes numbers, arrays, None and tuples of these by position, and returns nothing: results go into
    arrays.
    """
    if not COMPILED:
        return function
    from twin.mechanics.compiler import compile_whole

    return cast(Kernel, compile_whole(function, cache_folder()))


@functools.cache
def cache_folder() -> Path | None:
    """Return the folder of machine code: in the user's cache, or else next to the sources; None without.

    Machine code is only read from a folder of this user that no one else can write to.
    """
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    here = Path(__file__).parent
    for package in PACKAGES:
        for path in sorted((here.parent / package).glob("*.py")):
            digest.update(path.read_bytes())
    bases = [here / "__pycache__"]
    with contextlib.suppress(RuntimeError):  # without a home
        bases.insert(0, Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "endotwin")
    for base in bases:
        folder = base / f"kernels-{digest.hexdigest()[:16]}"
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder) and os.access(folder, os.W_OK):
                return folder
    return None


def _is_private(folder: Path) -> bool:
    """Return whether a folder, itself and no link, is this user's and writable by no one else."""
    status = folder.lstat()
    owned = not hasattr(os, "getuid") or status.st_uid == os.getuid()
    return owned and not folder.is_symlink() and not status.st_mode & 0o022


@contextlib.contextmanager
def on_compile(notify: Callable[[], None]) -> Iterator[None]:
    """Call a function, once, when a kernel is compiled within the block: that takes some seconds."""
    if not COMPILED:
        yield
        return
    from numba.core import event

    class Once(event.Listener):
        waiting = True

        def on_start(self, event: Any) -> None:
            if self.waiting:
                self.waiting = False
                notify()

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Once()):
        yield


@kernel
def copy_row(to: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy the numbers of an array into another one."""
    for i in range(len(to)):
        to[i] = values[i]


@kernel
def copy_rows(to: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy the numbers of an array of two dimensions into another one."""
    for i in range(to.shape[0]):
        for k in range(to.shape[1]):
            to[i, k] = values[i, k]
