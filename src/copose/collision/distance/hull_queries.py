"""Clearance tests of whole configurations in one or two calls of Pinocchio each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from copose.collision.carriers import Carrier
from copose.collision.shapes.solids import Shape
from copose.poses import Array, Indices, Pose
from copose.robots import Arm


@dataclass(frozen=True)
class HullQueryOptions:
    """Accuracy of Pinocchio's answers."""

    tolerance: float = 1e-10  # of GJK and EPA, relative
    unsure: float = 1e-8  # m, by which hulls must be farther apart than the clearance


class HullQueries:
    """Pinocchio's queries of all of some pairs of shapes at once."""

    def __init__(
        self,
        arms: Sequence[Arm],
        shapes: Sequence[tuple[Shape, Pose, Carrier]],
        pairs: Indices,
        clearance: float,
        options: HullQueryOptions = HullQueryOptions(),
    ) -> None:
        """Build the model of shapes, each with its placement in its carrier's frame; pairs of them,
        (k, 2), must keep a clearance, m.
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
        self._near = _Query(model, hulls, pairs, clearance + options.unsure, options.tolerance)
        self._hit = _Query(model, surfaces, pairs, clearance, options.tolerance)

    def verdict(self, x: Array) -> bool | None:
        """True where a configuration, (size,), is clear; None where hulls are too near and surfaces
        are apart: then one body may still enclose the other.
        """
        if not self._near.any(x):
            return True
        return False if self._hit.any(x) else None


class _Query:
    """A test of whether any of some pairs is nearer than a margin."""

    def __init__(
        self,
        model: pin.Model,
        geometries: Sequence[object],
        pairs: Indices,
        margin: float,
        tolerance: float,
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
            request.gjk_tolerance = request.epa_tolerance = tolerance
            # An answer must not depend on the one before.
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
            request.enable_contact = False
        self._manager = pin.BroadPhaseManager_SSaPCollisionManager(
            model, self._geometries, self._placed
        )

    def any(self, x: Array) -> bool:
        """True where some pair is nearer in a configuration, (size,)."""
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
