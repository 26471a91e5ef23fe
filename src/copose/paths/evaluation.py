"""Functions that numpy evaluates, for CasADi's solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from copose.poses import Array
from copose.progress import over


class Evaluated(ca.Callback):
    """A CasADi function of dense vectors whose outputs' nonzeros are computed by numpy."""

    def __init__(
        self,
        name: str,
        inputs: Sequence[tuple[str, int]],
        outputs: Sequence[tuple[str, ca.Sparsity]],
        evaluate: Callable[..., Sequence[Array | float]],
    ) -> None:
        """A function with named inputs, of some sizes, and named outputs, of some sparsity."""
        ca.Callback.__init__(self)
        self._inputs, self._outputs, self._evaluate = tuple(inputs), tuple(outputs), evaluate
        self.construct(name, {})

    def get_n_in(self) -> int:
        """Asked by CasADi."""
        return len(self._inputs)

    def get_n_out(self) -> int:
        """Asked by CasADi."""
        return len(self._outputs)

    def get_name_in(self, i: int) -> str:
        """Asked by CasADi."""
        return self._inputs[i][0]

    def get_name_out(self, i: int) -> str:
        """Asked by CasADi."""
        return self._outputs[i][0]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Asked by CasADi."""
        return ca.Sparsity.dense(self._inputs[i][1])

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        """Asked by CasADi."""
        return self._outputs[i][1]

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        """Asked by CasADi; zeros where the call has to end, for the solver to come to that soon."""
        if over():
            return [ca.DM(sparsity, np.zeros(sparsity.nnz())) for _, sparsity in self._outputs]
        values = self._evaluate(*(np.array(given.nonzeros()) for given in arguments))
        return [
            ca.DM(sparsity, np.asarray(value, dtype=float).ravel())
            for (_, sparsity), value in zip(self._outputs, values, strict=True)
        ]
