"""How Numba compiles kernels that call each other: less often, in fewer steps, and with what it found before.

Only what compiles imports this. It relies on inner parts of Numba, whose version `pyproject.toml` asks for.
"""

import contextlib
import ctypes
import gc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numba
from numba.core import (
    codegen,
    compiler,
    compiler_machinery,
    cpu,
    typed_passes,
    types,
    typing,
    untyped_passes,
)

# Of Numba's own steps, those that kernels need: they have no closures, exceptions or loops over whole arrays.
STEPS: tuple[Any, ...] = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)


class Part(cast(Any, codegen).JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel that is linked into its entry, but neither optimised nor made to run by itself."""

    def finalize(self) -> None:
        """Take in the kernels that this one calls."""
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """Return what makes code run: itself, which does not."""
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Leave out the environment, which is found in what runs."""

    def get_pointer_to_function(self, name: str) -> Any:
        """Let a call by Python, of what is no callable object here, raise a TypeError."""
        self._ensure_finalized()
        return ctypes.cast(ctypes.pythonapi.PyObject_Call, ctypes.c_void_p).value


class Whole(cast(Any, codegen).JITCodeLibrary):  # type: ignore[misc]
    """Code of an entry with all kernels inside, optimised in one pass instead of two.

    Numba's first pass serves the counts of references, which kernels do not have.
    """

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(opt=2, loop_vectorize=False, slp_vectorize=False)
        passes.run(self._final_module, builder)


class KernelCompiler(cast(Any, compiler).CompilerBase):  # type: ignore[misc]
    """Compiler of kernels, in fewer steps than Numba's."""

    Library: Any  # class of what it makes

    def define_pipelines(self) -> Any:
        """Return the steps of compilation."""
        state = self.state
        state["library"] = self.Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state["library"].enable_object_caching()
        passes = cast(Any, compiler_machinery).PassManager("kernel")
        for step in STEPS:
            passes.add_pass(step, step.name())
        passes.finalize()
        return [passes]


class EntryCompiler(KernelCompiler):
    """Compiler of what the rest of the program calls, and with it of all that it calls."""

    Library = Whole

    def _compile_core(self) -> Any:
        with _remembered(), _garbage_kept():
            return super()._compile_core()


class PartCompiler(KernelCompiler):
    """Compiler of kernels that other kernels call."""

    Library = Part


def compile_part(function: Callable[..., Any]) -> Any:
    """Compile a kernel into what calls it: one for all literal numbers of a type that it is called with."""
    part = _njit(function, PartCompiler, no_cpython_wrapper=True, forceinline=True)
    by_types = part.get_call_template
    part.get_call_template = lambda args, kws: by_types(tuple(map(types.unliteral, args)), kws)
    return part


def compile_whole(function: Callable[..., Any], cache: Path | None) -> Any:
    """Compile an entry, and keep its machine code in a folder, if there is one."""
    if cache is None:
        return _njit(function, EntryCompiler)
    with _replaced(numba.config, "CACHE_DIR", str(cache)):  # read when a function is decorated
        return _njit(function, EntryCompiler, cache=True)


def _njit(function: Callable[..., Any], pipeline: type[KernelCompiler], **options: Any) -> Any:
    options |= {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, "_nrt": False}
    return cast(Any, numba.njit)(pipeline_class=pipeline, **options)(function)


@contextlib.contextmanager
def _remembered() -> Iterator[None]:
    """Within the block, find once what an operation on some types returns, and import nothing again.

    By itself Numba searches the types, and imports all that it can compile, for one statement after another.
    """
    find, found = types.BaseFunction.get_call_type, {}

    def remembered(self: Any, context: Any, args: Any, keywords: Any) -> Any:
        key = self, context, tuple(args), tuple(keywords.items())
        if key not in found:
            found[key] = find(self, context, args, keywords)
        return found[key]

    def install(self: Any) -> None:
        for registry in list(self._registries):
            self.install_registry(registry)

    with (
        _replaced(types.BaseFunction, "get_call_type", remembered),
        _replaced(cpu.CPUContext, "load_additional_registries", install),
        _replaced(cast(Any, typing).Context, "load_additional_registries", install),
    ):
        yield


@contextlib.contextmanager
def _garbage_kept() -> Iterator[None]:
    """Within the block, do not search the objects of the whole program for garbage, a tenth of the time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextlib.contextmanager
def _replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)
