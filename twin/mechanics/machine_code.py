"""Machine code of kernels: made by Numba, kept in a folder, and loaded by LLVM alone.

To load Numba, and what it looks for, takes most of a second; LLVM loads what was kept in milliseconds. Code
is kept for one text of all kernels, one processor and one version of LLVM. A file that is damaged is made
anew. Where the folder cannot be written, the code serves this process alone.
"""

import contextlib
import ctypes
import functools
import hashlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any

from twin.mechanics.compiled import KERNELS, Entry

PACKAGES = ("mechanics", "physics", "reduced")
"""Packages that have kernels."""

_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
_MARK = b"machine code 1\n"
_lock = threading.RLock()
_engines: list[Any] = []
"""Engines of LLVM that own what was loaded."""
_tell: list[Callable[[], None]] = []
_namespaces: dict[str, dict[str, Any]] = {}
_made: dict[FunctionType, Any] = {}


def machine_code(kernel: FunctionType, arguments: Sequence[Any], layout: Sequence[str]) -> Callable[..., int]:
    """Return the machine code of a kernel, from the folder where it is kept, or made anew.

    Args:
        kernel: that is called.
        arguments: such as it will be called with.
        layout: of each, as of `PackedArgument`.
    """
    path = cache_folder() / _name(kernel, layout)
    with _lock:
        whole = _read(path)
        if whole is None:
            if _tell:
                _tell.pop()()
            whole = _make(kernel, arguments)
            _write(path, *whole)
        return _load(*whole)


def _name(kernel: FunctionType, layout: Sequence[str]) -> str:
    """Return the name of the file of a kernel for a layout of arguments."""
    told = hashlib.sha256(" ".join(layout).encode()).hexdigest()[:16]
    return f"{kernel.__module__}.{kernel.__name__}-{told}.bin"


@functools.cache
def cache_folder() -> Path:
    """Return the folder for machine code: beside the sources; in the user's cache if they are read-only."""
    import llvmlite
    import llvmlite.binding as llvm

    here = Path(__file__).parent
    told = hashlib.sha256(f"{llvmlite.__version__} {llvm.get_host_cpu_name()}".encode())
    told.update(llvm.get_host_cpu_features().flatten().encode())
    for package in PACKAGES:
        for path in sorted((here.parent / package).glob("*.py")):
            told.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "endotwin"
    return (here if os.access(here, os.W_OK) else home) / "__pycache__" / f"kernels-{told.hexdigest()[:16]}"


@contextlib.contextmanager
def telling(tell: Callable[[], None]) -> Iterator[None]:
    """Call a function, once, before kernels are compiled within the block: it takes some ten seconds."""
    _tell.append(tell)
    try:
        yield
    finally:
        _tell.clear()


def _read(path: Path) -> tuple[str, bytes] | None:
    """Return name and object code from a file; None where it is not there, or not whole."""
    try:
        text = path.read_bytes()
    except OSError:
        return None
    digest, rest = text[len(_MARK) :][:32], text[len(_MARK) + 32 :]
    if not text.startswith(_MARK) or hashlib.sha256(rest).digest() != digest:
        return None
    name, _, code = rest.partition(b"\n")
    return name.decode(), code


def _write(path: Path, name: str, code: bytes) -> None:
    """Keep object code; nothing is kept where that cannot be."""
    from twin.errors import InputError
    from twin.files.atomic import write_whole

    rest = name.encode() + b"\n" + code
    with contextlib.suppress(OSError, InputError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, _MARK + hashlib.sha256(rest).digest() + rest)


def _load(name: str, code: bytes) -> Callable[..., int]:
    """Return a function of object code."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    return _SIGNATURE(engine.get_function_address(name))


def _make(kernel: FunctionType, arguments: Sequence[Any]) -> tuple[str, bytes]:
    """Compile a kernel; return the name of its function, and its object code."""
    import llvmlite.binding as llvm

    from twin.mechanics.unpacking import ADDRESSES, unpacker

    called, unpack = _compilable()[kernel], unpacker(arguments)

    def call(blocks: Any) -> None:
        called(*unpack(blocks))

    dispatcher = _njit(call, False)
    dispatcher.compile((ADDRESSES,))
    (made,) = dispatcher.overloads.values()
    module = llvm.parse_assembly(dispatcher.inspect_llvm((ADDRESSES,)))
    for function in module.functions:
        known = function.name.startswith("llvm.") or llvm.address_of_symbol(function.name)
        if function.is_declaration and not known:
            raise RuntimeError(f"{kernel.__name__} calls {function.name}, which only Numba has")
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="jitdefault",
        jit=True,
    )
    return made.fndesc.llvm_func_name, target.emit_object(module)


def _compilable() -> dict[FunctionType, Any]:
    """Return all kernels as Numba compiles them, each of which finds the others so too."""
    for kernel, inline in KERNELS.items():
        if kernel not in _made:
            space = _namespaces.setdefault(kernel.__module__, dict(kernel.__globals__))
            copy = FunctionType(kernel.__code__, space, kernel.__name__, kernel.__defaults__)
            copy.__module__ = kernel.__module__
            _made[kernel] = _njit(copy, inline)
    for space in _namespaces.values():
        for name, value in space.items():
            found = value.kernel if isinstance(value, Entry) else value
            if isinstance(found, FunctionType) and found in _made:
                space[name] = _made[found]
    return _made


def _njit(function: Any, inline: bool) -> Any:
    """Return Numba's dispatcher of a function that makes no arrays, and that Python never calls."""
    import numba

    njit: Any = numba.njit
    return njit(
        error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=inline
    )(function)
