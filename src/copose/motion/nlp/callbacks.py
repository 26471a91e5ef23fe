"""CasADi callbacks: functions for its solvers that numpy evaluates."""

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

    def has_eval_buffer(self) -> bool:
        """Asked by CasADi: whether numbers are passed where they are."""
        return True

    def eval_buffer(
        self, given: Sequence[memoryview | None], wanted: Sequence[memoryview | None]
    ) -> int:
        """Asked by CasADi, None for what is zero or not wanted; zeros where the call has to end,
        for the solver to come to that soon.
        """
        values: Sequence[Array | float] = [0.0] * len(wanted)
        if not over():
            values = self._evaluate(*(
                np.zeros(size) if each is None else np.frombuffer(each).copy()
                for each, (_, size) in zip(given, self._inputs, strict=True)
            ))  # fmt: skip
        for each, value in zip(wanted, values, strict=True):
            if each is not None:
                np.frombuffer(each)[:] = np.ravel(value)
        return 0
