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
        """The number of inputs, for CasADi."""
        return len(self._inputs)

    def get_n_out(self) -> int:
        """The number of outputs, for CasADi."""
        return len(self._outputs)

    def get_name_in(self, i: int) -> str:
        """The name of an input, for CasADi."""
        return self._inputs[i][0]

    def get_name_out(self, i: int) -> str:
        """The name of an output, for CasADi."""
        return self._outputs[i][0]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """The sparsity of an input, for CasADi."""
        return ca.Sparsity.dense(self._inputs[i][1])

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        """The sparsity of an output, for CasADi."""
        return self._outputs[i][1]

    def has_eval_buffer(self) -> bool:
        """True: numbers are passed where they are, for CasADi."""
        return True

    def eval_buffer(
        self, arguments: Sequence[memoryview | None], results: Sequence[memoryview | None]
    ) -> int:
        """Evaluation for CasADi, into its own memory; zeros where the call has to end, for the
        solver to come to that soon.

        Args:
            arguments: None where one is zero.
            results: None where one is not asked for.
        """
        values: Sequence[Array | float] = [0.0] * len(results)
        if not over():
            values = self._evaluate(*(
                np.zeros(size) if numbers is None else np.frombuffer(numbers).copy()
                for numbers, (_, size) in zip(arguments, self._inputs, strict=True)
            ))  # fmt: skip
        for numbers, value in zip(results, values, strict=True):
            if numbers is not None:
                np.frombuffer(numbers)[:] = np.ravel(value)
        return 0
