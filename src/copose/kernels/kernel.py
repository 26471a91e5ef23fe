"""A small expression evaluated on many points at once."""

from __future__ import annotations

import ctypes
import hashlib
import platform
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from copose.kernels import cache, source
from copose.poses import Array
from copose.progress import heed

_NUMBERS = ctypes.c_double * 0


class Kernel:
    """A function y(x, p) of many points, by CasADi's virtual machine or by compiled code.

    Both give the same numbers bit for bit. Threads may share it.
    """

    def __init__(self, x: ca.SX, p: ca.SX, y: ca.SX) -> None:
        """The kernel of an expression y, (ny,), of symbols x, (nx,), and p, (np,)."""
        self._expressions = [x, p], [ca.densify(ca.vec(y))]
        self._function = ca.Function("kernel", *self._expressions)
        self._nx, self._np, self._ny = x.numel(), p.numel(), y.numel()
        self._evaluate: Callable[..., None] | None = None
        self._refused = False
        self._key: str | None = None
        # Those that no thread is using.
        self._idle = [_Interpreter(self._function)]

    @property
    def key(self) -> str:
        """The name of compiled code: a hash of the expression, its writer, compiler and machine."""
        # Python 3.11 locks a cached property while one thread computes it, and a fork would find it
        # locked for good.
        if self._key is None:
            code = hashlib.sha256(self._function.serialize().encode())
            setting = (*source.FLAGS, *(cache.compiler() or ()), platform.machine())
            code.update(Path(source.__file__).read_bytes() + "\0".join(setting).encode())
            self._key = code.hexdigest()[:32]
        return self._key

    def code(self) -> cache.Code:
        """The code that it is compiled from."""
        sizes = (self._nx, self._np, self._ny)
        inputs, (y,) = self._expressions
        # What stands twice is computed once: the same bits, and worth its time only here.
        return cache.Code(source.c_source(ca.Function("kernel", inputs, [ca.cse(y)])), sizes)

    @property
    def compiled(self) -> bool:
        """True where compiled code is in use."""
        return self._evaluate is not None

    def __call__(self, x: Array, p: Array) -> Array:
        """Values y, (count, ny), at x, (count, nx), and p, (np,) for all of them or (count, np).

        Raises:
            ValueError: they have other shapes, which compiled code could not tell.
            StoppedError: the call that it serves has to end.
        """
        heed()
        x, p = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(p, dtype=float)
        count = len(x) if x.ndim else 0
        if x.shape != (count, self._nx) or p.shape not in ((self._np,), (count, self._np)):
            raise ValueError(
                f"shapes {x.shape} and {p.shape} for {self._nx} and {self._np} numbers"
            )
        if self._evaluate is not None:
            return self._run(self._evaluate, x, p)
        return self._interpreted(x, p)

    def _run(self, evaluate: Callable[..., None], x: Array, p: Array) -> Array:
        """Values by compiled code."""
        y = np.empty((len(x), self._ny))
        stride = self._np if p.ndim == 2 else 0
        evaluate(len(x), _address(x), _address(p), stride, _address(y))
        return y

    def _interpreted(self, x: Array, p: Array) -> Array:
        """Values by the virtual machine, with buffers that no other thread is using."""
        try:
            interpreter = self._idle.pop()
        except IndexError:
            # A function of its own: one that is shared has a lock that a fork may find taken.
            interpreter = _Interpreter(ca.Function("kernel", *self._expressions))
        y = interpreter(x, p)
        self._idle.append(interpreter)
        return y

    def forgive(self) -> None:
        """Allow another attempt to load a library that was refused: it may have been replaced."""
        self._refused = False

    def load(self, probes: int = 4) -> bool:
        """Use the compiled code if the cache has it and it agrees at some random points.

        Args:
            probes: number of these points.

        Returns:
            Whether compiled code is in use.
        """
        if self._evaluate is not None or self._refused or not cache.wanted():
            return self.compiled
        try:
            library = cache.library(self.key)
            evaluate = None if library is None else library.evaluate
        except (OSError, AttributeError):
            self._refused = True
            return False
        if evaluate is None:
            return False
        pointer = ctypes.c_void_p
        evaluate.argtypes = [ctypes.c_long, pointer, pointer, ctypes.c_long, pointer]
        evaluate.restype = None
        rng = np.random.default_rng(0)
        x, p = rng.uniform(0.1, 1, (probes, self._nx)), rng.uniform(0.1, 1, (probes, self._np))
        values, expected = self._run(evaluate, x, p), self._interpreted(x, p)
        if np.allclose(values, expected, rtol=1e-9, atol=1e-9, equal_nan=True):
            self._evaluate = evaluate
        else:
            self._refused = True
        return self.compiled


def _address(array: Array) -> ctypes.Array[ctypes.c_double]:
    """The address of an array as ctypes passes it, in a fifth of the time of array.ctypes.data."""
    return _NUMBERS.from_buffer((array if array.flags.writeable else array.copy()).data)


class _Interpreter:
    """A function in CasADi's virtual machine for one thread at a time, by blocks of points."""

    def __init__(self, function: ca.Function, size: int = 32) -> None:
        self._ny, self._size = function.nnz_out(0), size
        self._one, self._block = _Buffered(function, 1), _Buffered(function, size)

    def __call__(self, x: Array, p: Array) -> Array:
        """Values y at x and p, see `Kernel`."""
        y = np.empty((len(x), self._ny))
        whole = len(x) - len(x) % self._size
        for first in range(0, whole, self._size):
            rows = slice(first, first + self._size)
            self._block(x[rows], p[rows] if p.ndim == 2 else p, y[rows])
        for k in range(whole, len(x)):
            self._one(x[k], p[k] if p.ndim == 2 else p, y[k])
        return y


class _Buffered:
    """Evaluation of a function on ``count`` points at once, without converting arrays."""

    def __init__(self, function: ca.Function, count: int) -> None:
        mapped = function.map(count) if count > 1 else function
        sizes = [mapped.nnz_in(0) // count, mapped.nnz_in(1) // count, mapped.nnz_out(0) // count]
        self._x, self._p, self._y = (np.zeros((count, size)) for size in sizes)
        self._buffer: Any
        self._buffer, self._trigger = mapped.buffer()
        self._buffer.set_arg(0, self._x.data)
        self._buffer.set_arg(1, self._p.data)
        self._buffer.set_res(0, self._y.data)

    def __call__(self, x: Array, p: Array, y: Array) -> None:
        self._x[:], self._p[:] = x, p
        self._trigger()
        y[:] = self._y


def build(kernels: Iterable[Kernel], *, wait: bool = False) -> bool:
    """Load compiled kernels, and compile those that the cache lacks.

    Args:
        kernels: to load.
        wait: for the compiler; else the virtual machine serves until a later call finds its work.

    Returns:
        Whether all of them are compiled.
    """
    missing = {kernel.key: kernel for kernel in kernels if not kernel.load()}
    if missing and cache.wanted():
        cache.fill({key: kernel.code for key, kernel in missing.items()}, wait=wait)
        for kernel in missing.values():
            kernel.forgive()
        missing = {key: kernel for key, kernel in missing.items() if not kernel.load()}
    return not missing
