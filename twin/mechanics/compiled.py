"""Kernels: functions of numbers and arrays that are compiled where Numba is installed, else run as they are.

Kernels call each other; an `entry` is one that the rest of the program calls. Its machine code, with all
kernels that it calls inside, is made once and kept (`machine_code.py`): Numba is loaded only to make it.

A kernel makes no arrays and assigns none to another one: there is nothing to be counted or given back then.
"""

import ctypes
import functools
import importlib.util
import struct
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

COMPILED = importlib.util.find_spec("numba") is not None
"""True where kernels are compiled; else the same code runs interpreted, a few hundred times slower."""
KERNELS: dict[FunctionType, bool] = {}
"""All kernels, and whether each is put into those that call it."""

_DONE = (0, -2)
"""Status of machine code that came to its end: with a value, and without."""
_SPARE = ctypes.create_string_buffer(8)
"""Room for the value and the error of machine code, which nobody reads."""


def compiled(kernel: Kernel) -> Kernel:
    """Register a kernel that others call."""
    KERNELS[cast(FunctionType, kernel)] = False
    return kernel


def inlined(kernel: Kernel) -> Kernel:
    """Register a small kernel, to be put into those that call it: a call would cost as much as its work."""
    KERNELS[cast(FunctionType, kernel)] = True
    return kernel


def entry(kernel: Kernel) -> Kernel:
    """Return a kernel as the rest of the program calls it: its machine code, where there can be any.

    It takes numbers, arrays, None and tuples of these by position, and returns nothing: what it finds it
    writes into arrays.
    """
    compiled(kernel)
    return cast(Kernel, Entry(kernel)) if COMPILED else kernel


def bound(kernel: Callable[..., None], *arguments: Any) -> Callable[..., None]:
    """Return an entry with its first arguments, packed once for all calls: their arrays must stay."""
    return Bound(kernel, *arguments) if isinstance(kernel, Entry) else functools.partial(kernel, *arguments)


class PackedArgument:
    """Argument as machine code reads it: words of 8 bytes, which are numbers, addresses, lengths and strides.

    Attributes:
        argument: it is held, so that what the words point to stays.
        layout: of the words.
        words: as bytes.
    """

    __slots__ = ("argument", "layout", "words")

    def __init__(self, argument: Any) -> None:
        """Pack a number, an array, None, or a tuple of them.

        Raises:
            TypeError: it is something else.
        """
        layout: list[str] = []
        words: list[float] = []
        _pack(argument, layout, words)
        self.argument, self.layout = argument, "".join(layout)
        self.words = struct.pack("".join(["d" if type(word) is float else "q" for word in words]), *words)


class Entry:
    """Kernel with its machine code for each layout of arguments that it was called with.

    Attributes:
        kernel: as Python.
    """

    def __init__(self, kernel: Callable[..., Any]) -> None:
        """Begin without machine code: it is found or made at the first call."""
        self.kernel = cast(FunctionType, kernel)
        self.__doc__, self.__name__, self.__module__ = kernel.__doc__, kernel.__name__, kernel.__module__
        self._functions: dict[tuple[str, ...], Callable[..., int]] = {}

    def __call__(self, *arguments: Any) -> None:
        """Run the machine code.

        Raises:
            TypeError: an argument is of a kind that it does not take.
            RuntimeError: the kernel raised an error, which it never should.
        """
        packed = [PackedArgument(argument) for argument in arguments]
        self.run(self.function(packed), _table(packed))

    def __reduce__(self) -> str:
        """Say how to copy it: it is the one of its module."""
        return self.__name__

    def function(self, packed: Sequence[PackedArgument]) -> Callable[..., int]:
        """Return the machine code for arguments of a layout."""
        layout = tuple([one.layout for one in packed])
        function = self._functions.get(layout)
        if function is None:
            from twin.mechanics.machine_code import machine_code

            arguments = [one.argument for one in packed]
            function = self._functions[layout] = machine_code(self.kernel, arguments, layout)
        return function

    def run(self, function: Callable[..., int], table: Any) -> None:
        """Run machine code with the addresses of its arguments."""
        if function(_SPARE, _SPARE, table) not in _DONE:
            raise RuntimeError(f"{self.__module__}.{self.__name__} failed")


class Bound:
    """Entry with its first arguments."""

    def __init__(self, of: Entry, *arguments: Any) -> None:
        """Pack them."""
        self._of, self._packed = of, [PackedArgument(argument) for argument in arguments]
        self._ready: tuple[Callable[..., int], Any] | None = None

    def __call__(self, *others: Any) -> None:
        """Run the machine code with the other arguments; raises as `Entry`."""
        if others:
            packed = [*self._packed, *[PackedArgument(argument) for argument in others]]
            self._of.run(self._of.function(packed), _table(packed))
            return
        if self._ready is None:
            self._ready = self._of.function(self._packed), _table(self._packed)
        self._of.run(*self._ready)

    def __reduce__(self) -> tuple[type["Bound"], tuple[Any, ...]]:
        """Say how to copy it: packed anew, as the arrays of the copy are elsewhere."""
        return Bound, (self._of, *[one.argument for one in self._packed])


def _table(packed: Sequence[PackedArgument]) -> Any:
    """Return the addresses of the words of all arguments."""
    return (ctypes.c_char_p * len(packed))(*[one.words for one in packed])


def _pack(argument: Any, layout: list[str], words: list[float]) -> None:
    """Add an argument to a layout and its words."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        layout.append(f"{argument.dtype.char}{argument.ndim}{'C' if flags.c_contiguous else 'A'}")
        if flags.carray and argument.size:  # a quicker way to the same address
            address = ctypes.addressof(ctypes.c_char.from_buffer(cast(Any, argument)))
        else:
            address = argument.ctypes.data
        words += (address, *argument.shape, *argument.strides)
    elif isinstance(argument, tuple):
        layout.append("(")
        for part in argument:
            _pack(part, layout, words)
        layout.append(")")
    elif argument is None:
        layout.append("n")
    elif isinstance(argument, (float, np.floating)):
        layout.append("f")
        words.append(float(argument))
    elif isinstance(argument, (int, np.integer, np.bool_)):
        layout.append("b" if isinstance(argument, (bool, np.bool_)) else "i")
        words.append(int(argument))
    else:
        raise TypeError(f"a kernel takes numbers, arrays and tuples of them, not {type(argument).__name__}")
