"""The object in the arms' hands: its inertia and how contacts act on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from copose.poses import Array, Pose, rotation_rows
from copose.problem import Space

N_PARAMETERS = 14


def object_parameters(pose: Pose, mass: float, inertia: ArrayLike) -> Array:
    """The numbers that stand for an object in every expression, shape (14,).

    Args:
        pose: of the centre of mass in the world.
        mass: kg.
        inertia: about the centre of mass in object axes, kg·m²: 3×3, or one number in the plane.
    """
    matrix = np.asarray(inertia, dtype=float)
    if matrix.ndim == 0:
        matrix = np.eye(3) * matrix
    upper = matrix[np.triu_indices(3)]
    return np.concatenate([pose.position, pose.quaternion, [mass], upper])


@dataclass(frozen=True, eq=False)
class HeldObject:
    """Expressions of the object's parameters.

    Attributes:
        parameters: position (3), quaternion (4), mass (1), upper inertia (6).
        position: centre of mass in the world.
        rotation: R_world_object.
        quaternion: the same.
        M_o: inertia in the task space, (m, m).
        W: one block per contact, (m, m) each: wrench at contact i on the object's centre of mass.
        W_pinv: Moore–Penrose inverse of [W_1 … W_K], one block per contact, (m, m) each.
    """

    parameters: ca.SX
    position: ca.SX
    rotation: ca.SX
    quaternion: ca.SX
    M_o: ca.SX
    W: tuple[ca.SX, ...]
    W_pinv: tuple[ca.SX, ...]

    @classmethod
    def held_at(cls, space: Space, grasps: Sequence[Pose]) -> HeldObject:
        """An object held at the given placements of the tips in its frame.

        r_i = R_object · grasp position is nominal: where the contact should be, not where a tip is.
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
        full = ca.diagcat(mass * ca.SX.eye(3), rotation @ inertia @ rotation.T)
        rows = list(space.rows)
        W = tuple(
            _grasp_matrix(rotation @ ca.SX(ca.DM(grasp.position)))[rows, rows] for grasp in grasps
        )
        WWt = sum((W_i @ W_i.T for W_i in W), ca.SX(space.m, space.m))
        D, LT, order = ca.ldl(WWt, False)
        inverse = ca.ldl_solve(ca.SX.eye(space.m), D, LT, order)
        W_pinv = tuple(W_i.T @ inverse for W_i in W)
        return cls(parameters, position, rotation, quaternion, full[rows, rows], W, W_pinv)


def _grasp_matrix(r: ca.SX) -> ca.SX:
    """[[I, 0], [S(r), I]]."""
    return ca.blockcat([[ca.SX.eye(3), ca.SX(3, 3)], [ca.skew(r), ca.SX.eye(3)]])
