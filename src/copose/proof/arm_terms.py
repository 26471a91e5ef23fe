"""Enclosures of what an arm adds to the sums of an ellipsoid, along its self-motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copose.capability import ClosedChainVelocity, ExternalForce, Form
from copose.capability.torque_maps import Pseudoinverse, TorqueOptimal
from copose.poses import Array, Mask
from copose.proof.intervals import Interval, inverse, unit
from copose.proof.taylor import Taylor, cross, inverse_model, joined
from copose.proof.tubes import ChainModel, SelfMotionTubes


@dataclass(frozen=True, eq=False)
class NormalGram:
    """A model of CᵀG C, which is about I in the middle, and C⁻¹, (count, m, m)."""

    model: Taylor
    back: Array

    @classmethod
    def of(cls, A: Taylor, *, square: bool) -> NormalGram:
        """That of G = AᵀA, or of a symmetric A itself."""
        middle = A.value.mid if square else A.value.mid.swapaxes(1, 2) @ A.value.mid
        middle = (middle + middle.swapaxes(1, 2)) / 2
        sound = np.asarray(np.isfinite(middle).all(axis=(1, 2)))
        middle = np.where(sound[:, None, None], middle, np.eye(middle.shape[-1]))
        sound = np.asarray(np.linalg.eigvalsh(middle)[:, 0] > 0)
        middle = np.where(sound[:, None, None], middle, np.eye(middle.shape[-1]))
        back = np.asarray(np.linalg.cholesky(middle).swapaxes(1, 2))
        C = Taylor.fixed(inverse(Interval.exactly(back))[0], A.h)
        turned = A @ C
        return cls((C.T if square else turned.T) @ turned, back)

    def vertices(self, ends: Array, *, upper: bool) -> tuple[Array, Array]:
        """Matrices at two ends t, (count, 2), that interpolated are below G(t) in Loewner's order,
        or above it, (count, 2, m, m); and by how much, about, relative.
        """
        model, sign, m = self.model, -1.0 if upper else 1.0, self.back.shape[-1]
        bend, far = model.curvature.mid, np.abs(ends).max(axis=1)
        values, vectors = np.linalg.eigh(sign * (bend + bend.swapaxes(1, 2)) / 2)
        falls = (vectors * np.minimum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)
        norms = model.parts.rad.sum(axis=3).max(axis=2)
        t, square = ends[..., None, None], sign * (far**2)[:, None, None, None]
        bound = model.value.mid[:, None] + t * model.slope.mid[:, None] + square * falls[:, None]
        # Rounding of this and of what follows, seen where G is about I.
        around = np.abs(self.back) @ np.abs(np.linalg.inv(self.back))
        sizes = around.swapaxes(1, 2)[:, None] @ (np.abs(bound) + np.eye(m)) @ around[:, None]
        off = norms[0] + far * norms[1] + far**2 * norms[2]
        off = off + 32 * m * unit(bound) * sizes.sum(axis=3).max(axis=(1, 2))
        bound = bound - sign * off[:, None, None, None] * np.eye(m)
        whole = self.back.swapaxes(1, 2)[:, None] @ bound @ self.back[:, None]
        return (whole + whole.swapaxes(2, 3)) / 2, off - 2 * far**2 * np.minimum(values[:, 0], 0.0)


@dataclass(frozen=True, eq=False)
class ArmTerms:
    """The terms of an arm, see `Form.arm_terms`."""

    tubes: SelfMotionTubes  # of the arm
    form: Form  # the ellipsoid
    tie: Array  # numbers of the object where it is, see `KernelInputs`

    @property
    def scale(self) -> Array:
        """Torques that the ball is measured in, as a column, (n, 1)."""
        return self.tie[-self.tubes.arm.n :, None]

    def coupling(self, name: str) -> Array:
        """A part of the coupling, (m, m)."""
        m, k = self.tubes.space.m, self.form.uses.index(name)
        return self.tie[k * m * m : (k + 1) * m * m].reshape(m, m).T

    def enclosed(self, q: Taylor) -> tuple[list[NormalGram], Mask]:
        """Models of the terms along q, and where they are proved."""
        terms, ok = ENCLOSURES[type(self.form)](self, q, self.tubes.chain(q))
        # The first of two is symmetric, and no factor.
        two = len(terms) == 2
        return [NormalGram.of(A, square=two and k == 0) for k, A in enumerate(terms)], ok

    def pseudoinverse(self, q: Taylor, J: Taylor) -> tuple[Taylor, Mask]:
        """J⁺ from the inverse of [J; vᵀ]: its columns but the last, less their part along that."""
        n, m = self.tubes.arm.n, self.tubes.space.m
        if n == m:
            return inverse_model(J)
        Y, regular = inverse_model(joined([J, Taylor.fixed(q.slope.mid[:, None], q.h)], 1))
        X, along = Y[:, :, :m], Y[:, :, m:]
        square, positive = inverse_model(along.T @ along)
        return X - along @ (square @ (along.T @ X)), regular & positive

    def inertia_factor(self, chain: ChainModel) -> Taylor:
        """F with M = FᵀF: momenta of the links, and of the rotors, (count, 7n, n)."""
        arm, rows = self.tubes.arm, []
        for b, joint in enumerate(arm.joints):
            body, R = joint.body, chain.rotations[b]
            values, vectors = np.linalg.eigh(body.inertia)
            root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
            z = chain.axes * (np.arange(arm.n) <= b).astype(float)
            center = chain.origins[:, :, b : b + 1] + R @ body.com[:, None]
            rows += [cross(z, center - chain.origins) * np.sqrt(body.mass), root @ (R.T @ z)]
        rotors = np.diag(np.sqrt([joint.armature for joint in arm.joints]))
        return joined([*rows, Taylor.fixed(rotors[None], chain.J.h)], 1)


Enclosed = tuple[list[Taylor], Mask]


def _torque_map(arm: ArmTerms, q: Taylor, chain: ChainModel) -> Enclosed:
    """T⁻¹A of the arm."""
    P, ok = arm.pseudoinverse(q, chain.J)
    F = arm.inertia_factor(chain)
    A = F.T @ (F @ (P @ arm.coupling("motion"))) + chain.J.T @ arm.coupling("load")
    return [A * (1 / arm.scale)], ok


def _forward_dynamics(arm: ArmTerms, q: Taylor, chain: ChainModel) -> Enclosed:
    """S and a factor of R, from the inverse of [M Jᵀ; J 0]."""
    n, m, X, F = (
        arm.tubes.arm.n,
        arm.tubes.space.m,
        arm.coupling("motion"),
        arm.inertia_factor(chain),
    )
    below = joined([chain.J, Taylor.fixed(np.zeros((1, m, m)), q.h)], 2)
    Y, ok = inverse_model(joined([joined([F.T @ F, chain.J.T], 2), below], 1))
    return [X.T @ (-Y[:, n:, n:] @ X), Y[:, :n, n:] @ X * arm.scale], ok


def _speeds(arm: ArmTerms, q: Taylor, chain: ChainModel) -> Enclosed:
    """J⁺X."""
    P, ok = arm.pseudoinverse(q, chain.J)
    return [P @ arm.coupling("motion")], ok


def _torques(arm: ArmTerms, q: Taylor, chain: ChainModel) -> Enclosed:
    """T⁻¹Jᵀ of the arm's share."""
    return [chain.J.T @ arm.coupling("share") * (1 / arm.scale)], np.ones(len(q.h), dtype=bool)


ENCLOSURES: dict[type[Form], Callable[[ArmTerms, Taylor, ChainModel], Enclosed]] = {
    Pseudoinverse: _torque_map,
    TorqueOptimal: _forward_dynamics,
    ClosedChainVelocity: _speeds,
    ExternalForce: _torques,
}
