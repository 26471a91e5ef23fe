"""Objectives that measure an ellipsoid: its volume, and its radii along directions."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import casadi as ca
import numpy as np

from copose.capability import Ellipsoid, Form, log_ball_volume, log_det
from copose.capability.sums import log_dets, traces
from copose.cell.context import PostureContext
from copose.cell.dynamics import CellDynamics, Holding
from copose.mechanics import System
from copose.objectives.objective import Cuts, Objective, Term
from copose.poses import Array


class EllipsoidMeasure(Objective):
    """A measure of an ellipsoid {x : xᵀG x ≤ 1}, larger is better.

    Attributes:
        form: the ellipsoid's.
        numbers: parameters of its expressions, such as directions; they vary without rebuilding.
    """

    summable = True
    form: Form

    def __init__(
        self,
        kind: str,
        unit: str,
        form: Form,
        scales: Sequence[Array],
        numbers: Array | None = None,
    ) -> None:
        """A measure with its unit and parameters."""
        super().__init__(kind, unit, form, scales)
        self.form = form
        self.numbers: Array = np.zeros(0) if numbers is None else numbers

    @abstractmethod
    def of(self, ellipsoid: Ellipsoid) -> float:
        """The value of a measured ellipsoid."""

    @abstractmethod
    def of_grams(self, grams: Array) -> Array:
        """Values of many Gram matrices (count, a, a); NaN or −inf where there is none."""

    @abstractmethod
    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Term:
        """The term in a program, in terms of G, (a, a), and of the parameters as symbols."""

    def parameters(self, holding: Holding | None) -> Array:
        """Directions and weights, wherever the object is."""
        return self.numbers

    def values(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Values by the sums of the arms' terms."""
        return self.values_and_grams(context, q)[0]

    def values_and_grams(
        self, context: PostureContext, q: Sequence[Array]
    ) -> tuple[Array, Array | None]:
        """Values by the sums of the arms' terms."""
        grams = context.grams(context.sums(q))
        return self._of_sound(grams), grams

    def values_of_sums(self, context: PostureContext, sums: Array) -> Array:
        """Values by G."""
        return self._of_sound(context.grams(sums))

    def bound_sides(self, *, sliced: bool) -> tuple[tuple[int, bool], ...]:
        """G from below: most measures fall as G grows."""
        return ((0, False),) if self.form.n_terms == 1 else ()

    def _of_sound(self, grams: Array) -> Array:
        values = np.full(len(grams), np.nan)
        sound = np.isfinite(grams).all(axis=(1, 2))
        values[sound] = self.of_grams(grams[sound])
        return values

    def gram(self, sums: ca.SX, M_o: ca.SX, axes: Sequence[int]) -> ca.SX:
        """G of the stacked sums, its slice by the axes, (a, a)."""
        chosen = list(axes)
        return self.form.summed_gram(sums, M_o)[chosen, chosen]

    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """Itself, or its stand-in without kinks."""
        return self.formulate(self.gram(sums, M_o, axes), numbers).value

    def term(
        self,
        system: System,
        axes: Sequence[int],
        numbers: ca.SX,
        capacity: CellDynamics | None,
        inertia: ca.SX | None = None,
    ) -> Term:
        """The measure of the system's G."""
        chosen = list(axes)
        gram = self.form.system_gram(system, self.scales)[chosen, chosen]
        return self.formulate(gram, numbers)

    def motion_start(
        self, context: PostureContext, q: Sequence[Array], cuts: Cuts, slack: float
    ) -> Array:
        """Starts by G there."""
        gram = context.grams(context.sums(q))[0]
        return self.sharp_start(gram, slack) if np.isfinite(gram).all() else np.full(1, np.nan)

    def at_ceiling(self, gram: Array) -> bool:
        """True to 1e-9."""
        return bool(self.of_grams(gram[None])[0] >= self.ceiling - 1e-9)


class Volume(EllipsoidMeasure):
    """log-volume, −½ log det G + log(volume of the unit ball)."""

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The sum of the logarithms of the semi-axes."""
        return ellipsoid.log_volume

    def of_grams(self, grams: Array) -> Array:
        """Values by the determinants."""
        sign, logs = np.linalg.slogdet(grams)
        return np.where(sign > 0, log_ball_volume(grams.shape[-1]) - logs / 2, -np.inf)

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Term:
        """The measure itself, which is smooth."""
        return smooth_term(log_ball_volume(gram.shape[0]) - log_det(gram) / 2, gram)

    def bound_sides(self, *, sliced: bool) -> tuple[tuple[int, bool], ...]:
        """G from below; torque-optimally, of all axes, S from below and R from above."""
        if self.form.n_terms == 1:
            return ((0, False),)
        return () if sliced else ((0, False), (1, True))

    def upper_bounds(self, corners: Array, M_o: Array) -> Array:
        """−½ log det G is convex; of −log det S + ½ log det R the second is below its tangent."""
        ball = log_ball_volume(corners.shape[2])
        if corners.shape[1] == 1:
            return np.asarray(ball - np.min([log_dets(G) for (G,) in corners], axis=0) / 2)
        middle = np.asarray(corners[:, 1].mean(axis=0))
        inverse = np.moveaxis(np.linalg.inv(np.moveaxis(middle, -1, 0)), 0, -1)
        falls = [log_dets(S + M_o[..., None]) - traces(inverse, R - middle) / 2 for S, R in corners]
        return np.asarray(ball + log_dets(middle) / 2 - np.min(falls, axis=0))


class TaskCompatibility(EllipsoidMeasure):
    """Σ_j w_j log d(u_j), d(u) = (uᵀG u)^(−1/2) (after S. L. Chiu, 1988)."""

    def __init__(
        self, form: Form, scales: Sequence[Array], directions: Array, weights: Array
    ) -> None:
        """Unit directions (k, a) and their weights (k,)."""
        numbers = np.concatenate([directions.ravel(), weights])
        super().__init__("task-compatibility", "log", form, scales, numbers)
        self.directions, self.weights = directions, weights

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The weighted sum of logarithms of the radii along the directions."""
        radii = [ellipsoid.radius(u) for u in self.directions]
        return float(self.weights @ np.log(radii))

    def of_grams(self, grams: Array) -> Array:
        """Values by the quadratic forms uᵀG u."""
        forms = np.einsum("ka,nab,kb->nk", self.directions, grams, self.directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-0.5 * np.log(forms) @ self.weights)

    def bound_sides(self, *, sliced: bool) -> tuple[tuple[int, bool], ...]:
        """G from both sides."""
        return ((0, False), (0, True)) if self.form.n_terms == 1 else ()

    def upper_bounds(self, corners: Array, M_o: Array) -> Array:
        """−½ w log(uᵀG u) is convex for w > 0, and else below its tangent in the middle."""
        bound = np.zeros((len(corners), corners.shape[-1]))
        for u, w in zip(self.directions, self.weights, strict=True):
            forms = traces(np.outer(u, u)[..., None], corners[:, int(w < 0)])
            middle = forms.mean(axis=0)
            with np.errstate(divide="ignore", invalid="ignore"):
                tangent = np.log(middle) + forms / middle - 1
                bound -= w / 2 * (np.log(forms) if w > 0 else tangent)
        return np.asarray(bound.max(axis=0))

    def formulate(self, gram: ca.SX, numbers: ca.SX) -> Term:
        """The measure itself, which is smooth."""
        k, a = self.directions.shape
        value = ca.SX(0)
        for j in range(k):
            u = numbers[a * j : a * j + a]
            value -= numbers[k * a + j] * ca.log(ca.dot(u, gram @ u)) / 2
        return smooth_term(value, gram)


def smooth_term(value: ca.SX, gram: ca.SX) -> Term:
    """The term of a measure of G that is smooth as it is."""
    return Term(value, value, ca.SX(0, 1), gram=gram)
