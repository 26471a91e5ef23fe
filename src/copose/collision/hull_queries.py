"""Which configurations are clear, and which not, in a call of Pinocchio or two each."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from copose.collision.carriers import Carrier
from copose.collision.solids import Shape
from copose.poses import Array, Indices, Pose
from copose.robots import Arm

# How exactly it is computed; what is nearer to a threshold is left to others, m.
_TOLERANCE, _UNSURE = 1e-10, 1e-8


class HullQueries:
    """Pinocchio's one-call queries of some pairs of shapes."""

    def __init__(
        self,
        arms: Sequence[Arm],
        shapes: Sequence[tuple[Shape, Pose, Carrier]],
        pairs: Indices,
        clearance: float,
    ) -> None:
        """Build the model.

        Args:
            arms: that carry the shapes.
            shapes: each with its placement in its carrier's frame.
            pairs: numbers of shapes that are tested against each other, (k, 2).
            clearance: what they must keep, m.
        """
        model, joints = _joints(arms)
        hulls, surfaces = [], []
        used, numbers = np.unique(pairs, return_inverse=True)
        for k in used:
            shape, pose, carrier = shapes[k]
            place = joints[carrier], pin.SE3(pose.rotation, pose.position)
            hulls.append(pin.GeometryObject(str(k), *place, shape.bound))
            surfaces.append(pin.GeometryObject(str(k), *place, shape.coal))
        pairs = numbers.reshape(-1, 2)
        self._near = _Query(model, hulls, pairs, clearance + _UNSURE)
        self._hit = _Query(model, surfaces, pairs, clearance)

    def verdict(self, x: Array) -> bool | None:
        """Whether a configuration, (size,), is clear; None where hulls do not tell and surfaces are
        apart: then one body may still enclose the other.
        """
        if not self._near.any(x):
            return True
        return False if self._hit.any(x) else None


class _Query:
    """Whether some of the pairs are nearer than a margin."""

    def __init__(
        self,
        model: pin.Model,
        geometries: Sequence[object],
        pairs: Indices,
        margin: float,
    ) -> None:
        self._model, self._data = model, model.createData()
        self._geometries = pin.GeometryModel()
        for geometry in geometries:
            self._geometries.addGeometryObject(geometry)
        for a, b in pairs.tolist():
            self._geometries.addCollisionPair(pin.CollisionPair(a, b))
        self._placed = pin.GeometryData(self._geometries)
        for request in self._placed.collisionRequests:
            request.security_margin = margin
            request.gjk_tolerance = request.epa_tolerance = _TOLERANCE
            # What was asked before must not matter.
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
            request.enable_contact = False
        self._manager = pin.BroadPhaseManager_SSaPCollisionManager(
            model, self._geometries, self._placed
        )

    def any(self, x: Array) -> bool:
        """In a configuration, (size,)."""
        near: bool = pin.computeCollisions(self._model, self._data, self._manager, x, True)
        return near


def _joints(arms: Sequence[Arm]) -> tuple[pin.Model, dict[Carrier, int]]:
    """Object and arms as one model whose configurations are those of `configurations`."""
    model = pin.Model()
    free, nothing = pin.JointModelFreeFlyer(), pin.SE3.Identity()
    numbers = {Carrier("world"): 0}
    numbers[Carrier("object")] = model.addJoint(0, free, nothing, "object")
    for i, arm in enumerate(arms):
        parent = numbers[Carrier("root", i)] = model.addJoint(0, free, nothing, f"root {i}")
        for j, joint in enumerate(arm.joints):
            revolute = joint.kind == "revolute"
            kind = pin.JointModelRevoluteUnaligned if revolute else pin.JointModelPrismaticUnaligned
            place = pin.SE3(joint.placement.rotation, joint.placement.position)
            parent = model.addJoint(parent, kind(np.array(joint.axis)), place, f"joint {i} {j}")
            numbers[Carrier("joint", i, j)] = parent
    return model, numbers
