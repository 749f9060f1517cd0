"""Arguments of machine code as Numba's values: read from the words that `PackedArgument` packs."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba.core import extending
from numba.core import types as numba_types
from numba.np import arrayobj, numpy_support

types = cast(Any, numba_types)
_WORD = ir.IntType(64)
ADDRESSES = types.CPointer(types.int64)
"""Numba's type of what machine code is given: the address of the words of each argument."""


def unpacker(arguments: Sequence[Any]) -> Any:
    """Return a function for Numba that reads arguments such as these from the addresses of their words."""
    wanted = types.Tuple([_type_of(argument) for argument in arguments])
    intrinsic = cast(Any, extending).intrinsic

    @intrinsic  # type: ignore[untyped-decorator]
    def unpack(typing: Any, blocks: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            (table,) = given
            values = []
            for place, of in enumerate(wanted.types):
                address = builder.load(builder.gep(table, [_WORD(place)]))
                values.append(_Words(context, builder, address).value(of))
            return context.make_tuple(builder, wanted, values)

        return wanted(ADDRESSES), build

    return unpack


def _type_of(argument: Any) -> Any:
    """Return Numba's type of an argument."""
    if isinstance(argument, np.ndarray):
        layout = "C" if argument.flags.c_contiguous else "A"
        return types.Array(cast(Any, numpy_support).from_dtype(argument.dtype), argument.ndim, layout)
    if isinstance(argument, tuple):
        parts = [_type_of(part) for part in argument]
        named = hasattr(argument, "_fields")
        return types.NamedTuple(parts, type(argument)) if named else types.Tuple(parts)
    if argument is None:
        return types.none
    if isinstance(argument, (bool, np.bool_)):
        return types.boolean
    return types.int64 if isinstance(argument, (int, np.integer)) else types.float64


class _Words:
    """Words of one argument, read one after the other."""

    def __init__(self, context: Any, builder: Any, address: Any) -> None:
        self._context, self._builder = context, builder
        self._words, self._place = builder.inttoptr(address, _WORD.as_pointer()), 0

    def value(self, of: Any) -> Any:
        """Return LLVM's value of a type, from the next words."""
        context, builder = self._context, self._builder
        if isinstance(of, types.BaseTuple):
            return context.make_tuple(builder, of, [self.value(part) for part in of.types])
        if isinstance(of, types.Array):
            return self._array(of)
        if of is types.none:
            return context.get_dummy_value()
        if isinstance(of, types.Float):
            return builder.bitcast(self._next(), ir.DoubleType())
        return context.cast(builder, self._next(), types.int64, of)

    def _next(self) -> Any:
        self._place += 1
        return self._builder.load(self._builder.gep(self._words, [_WORD(self._place - 1)]))

    def _array(self, of: Any) -> Any:
        context, builder = self._context, self._builder
        array = cast(Any, arrayobj).make_array(of)(context, builder)
        element = context.get_data_type(of.dtype)
        data = builder.inttoptr(self._next(), element.as_pointer())
        shape = [self._next() for _ in range(of.ndim)]
        strides = [self._next() for _ in range(of.ndim)]
        size = _WORD(context.get_abi_sizeof(element))
        cast(Any, arrayobj).populate_array(
            array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None
        )
        return array._getvalue()
