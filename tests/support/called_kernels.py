"""Kernels, as Python can call them."""

from twin.mechanics.kernels import COMPILED


def called_by_python(kernel):
    """Return a function that calls a kernel: Python cannot, where kernels are compiled."""
    if not COMPILED:
        return kernel
    import numba

    return numba.njit(lambda *arguments: kernel(*arguments))
