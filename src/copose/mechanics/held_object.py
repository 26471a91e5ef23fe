"""The held object: its inertia, grasp matrices, and load distribution over contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from copose.mechanics.chain import Frame
from copose.poses import Array, Pose, rotation_rows
from copose.problem import Space

# Parameters of an object: position, quaternion, mass, and six entries of the inertia.
N_PARAMETERS = 14


def object_parameters(pose: Pose, mass: float, inertia: ArrayLike) -> Array:
    """The parameters of an object in every expression, (14,).

    Args:
        pose: of the centre of mass in the world.
        mass: kg.
        inertia: about the centre of mass in object axes, kg·m²: 3×3, or one number in the plane.
    """
    matrix = np.asarray(inertia, dtype=float)
    if matrix.ndim == 0:
        matrix = np.eye(3) * matrix
    upper = matrix[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return np.concatenate([pose.position, pose.quaternion, [mass], upper])


@dataclass(frozen=True, eq=False)
class HeldObject:
    """The held object as expressions of its parameters."""

    parameters: ca.SX  # position (3), quaternion (4), mass (1), upper inertia (6)
    position: ca.SX  # centre of mass in the world
    rotation: ca.SX  # R_world_object
    quaternion: ca.SX  # the same
    mass: ca.SX  # kg
    M_o: ca.SX  # inertia in the task space, (m, m)
    # One block per contact, (m, m) each: wrench at contact i on the object's centre of mass.
    W: tuple[ca.SX, ...]
    # One block per contact, (b, m) each: the same with the moments that forces exert about the
    # centre of mass in the linear spaces too, see `Space.balance`.
    balance: tuple[ca.SX, ...]
    # A right inverse of [W_1 … W_K], one block per contact, (m, m) each: the distribution of the
    # object's wrench over the contacts.
    W_pinv: tuple[ca.SX, ...]
    inertia: ca.SX  # 3×3 about the centre of mass, world axes
    contacts: tuple[ca.SX, ...]  # r_i, from the centre of mass to contact i, world axes, (3,) each

    @classmethod
    def held_at(
        cls, space: Space, grasps: Sequence[Frame], load_distribution: str = "moore-penrose"
    ) -> HeldObject:
        """An object held at the given placements of the tips in its frame.

        Contacts r_i = R_object · grasp position are nominal, whatever the arms' joints are.

        Args:
            space: the task space.
            grasps: T_object_tip, one per arm.
            load_distribution: which W⁺: ``moore-penrose`` Wᵀ(W Wᵀ)⁻¹, or ``nonsqueezing``
                W_i⁻¹/K, every arm an equal share of the wrench reduced to the centre of mass
                (I. D. Walker, R. A. Freeman, S. I. Marcus, 1991).
        """
        parameters = ca.SX.sym("object", N_PARAMETERS)
        position, quaternion, mass, upper = ca.vertsplit(parameters, [0, 3, 7, 8, N_PARAMETERS])
        rotation = ca.blockcat(rotation_rows(quaternion))
        inertia = ca.blockcat(
            [
                [upper[0], upper[1], upper[2]],
                [upper[1], upper[3], upper[4]],
                [upper[2], upper[4], upper[5]],
            ]
        )
        inertia = rotation @ inertia @ rotation.T
        full = ca.diagcat(mass * ca.SX.eye(3), inertia)
        rows = list(space.rows)
        contacts = tuple(rotation @ grasp.position for grasp in grasps)
        W = tuple(_grasp_matrix(r)[rows, rows] for r in contacts)
        balanced = list(space.balance)
        if load_distribution == "nonsqueezing":
            W_pinv = tuple(_grasp_matrix(-r)[rows, rows] / len(contacts) for r in contacts)
        else:
            W_pinv = _moore_penrose(W)
        return cls(
            parameters=parameters,
            position=position,
            rotation=rotation,
            quaternion=quaternion,
            mass=mass,
            M_o=full[rows, rows],
            W=W,
            balance=tuple(_grasp_matrix(r)[balanced, rows] for r in contacts),
            W_pinv=W_pinv,
            inertia=inertia,
            contacts=contacts,
        )


def _moore_penrose(W: tuple[ca.SX, ...]) -> tuple[ca.SX, ...]:
    """The Moore–Penrose inverse Wᵀ(W Wᵀ)⁻¹, one block per contact."""
    m = W[0].shape[0]
    D, LT, order = ca.ldl(sum((W_i @ W_i.T for W_i in W), ca.SX(m, m)), False)
    inverse = ca.ldl_solve(ca.SX.eye(m), D, LT, order)
    return tuple(W_i.T @ inverse for W_i in W)


def _grasp_matrix(r: ca.SX) -> ca.SX:
    """The grasp matrix [[I, 0], [S(r), I]] of a contact at r, (6, 6)."""
    return ca.blockcat([[ca.SX.eye(3), ca.SX(3, 3)], [ca.skew(r), ca.SX.eye(3)]])
