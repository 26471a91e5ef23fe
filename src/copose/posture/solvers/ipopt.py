"""IPOPT, which stops where the call that it serves has to end."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from copose.poses import Array
from copose.progress import heed, over, sheltered


class Ipopt:
    """A nonlinear program that IPOPT solves, as CasADi's nlpsol builds it."""

    def __init__(
        self,
        name: str,
        program: dict[str, ca.SX] | ca.Function,
        sizes: tuple[int, int, int],
        options: dict[str, Any],
    ) -> None:
        """Build the solver of a program with sizes of x, p and g, by options of nlpsol."""
        # CasADi keeps no reference of its own to Python's callbacks.
        self._between = _Between(sizes)
        options = options | {"iteration_callback": self._between}
        self._solver = ca.nlpsol(name, "ipopt", program, options)

    def __call__(self, **given: Array) -> dict[str, ca.DM]:
        """One run, with the arguments of CasADi's function.

        Raises:
            StoppedError: the call that it serves has to end.
        """
        # What raises within a run would look to IPOPT like a point without values.
        with sheltered():
            answer: dict[str, ca.DM] = self._solver(**given)
        heed()
        return answer

    def stats(self) -> dict[str, Any]:
        """Statistics of the last run."""
        stats: dict[str, Any] = self._solver.stats()
        return stats


class _Between(ca.Callback):
    """A callback between iterations, which returns 1 where no other may follow."""

    def __init__(self, sizes: tuple[int, int, int]) -> None:
        ca.Callback.__init__(self)
        nx, np, ng = sizes
        self._sizes = {"x": nx, "f": 1, "g": ng, "lam_x": nx, "lam_g": ng, "lam_p": np}
        self.construct("between", {})

    def get_n_in(self) -> int:
        """Number of inputs, for CasADi."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Number of outputs, for CasADi."""
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Shape of an input, for CasADi."""
        size = self._sizes[ca.nlpsol_out(i)]
        return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        """Shape of an output, for CasADi."""
        return ca.Sparsity.dense(1)

    def has_eval_buffer(self) -> bool:
        """True, so that CasADi makes no matrix of anything."""
        return True

    def eval_buffer(self, arg: tuple[memoryview, ...], res: tuple[memoryview, ...]) -> int:
        """The answer to CasADi, in its buffers."""
        np.frombuffer(res[0])[0] = float(over())
        return 0
