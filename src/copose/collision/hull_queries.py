"""Which configurations are surely clear, and which surely not, by convex hulls in one call each."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from copose.collision.carriers import Carrier
from copose.collision.solids import Shape
from copose.poses import Array, Pose
from copose.robots import Arm

# How exactly it is computed; what is nearer to a threshold is left to others, m.
_TOLERANCE, _UNSURE = 1e-10, 1e-8


class HullQueries:
    """Pinocchio's one-call queries of some pairs of shapes."""

    def __init__(
        self,
        arms: Sequence[Arm],
        shapes: Sequence[tuple[Shape, Pose, Carrier]],
        pairs: Sequence[tuple[int, int]],
        clearance: float,
    ) -> None:
        """Build the model.

        Args:
            arms: that carry the shapes.
            shapes: each with its placement in its carrier's frame.
            pairs: numbers of shapes that are tested against each other.
            clearance: what they must keep, m.
        """
        self._model, joints = _joints(arms)
        self._data = self._model.createData()
        geometries = [
            pin.GeometryObject(
                str(k), joints[carrier], pin.SE3(pose.rotation, pose.position), shape.bound
            )
            for k, (shape, pose, carrier) in enumerate(shapes)
        ]
        below = np.array([shape.below for shape, _, _ in shapes])
        margins = {pair: clearance - below[pair[0]] - below[pair[1]] - _UNSURE for pair in pairs}
        surely = [pair for pair in pairs if margins[pair] > 0]
        self._clear = _Query(geometries, dict.fromkeys(pairs, clearance + _UNSURE))
        self._near = _Query(geometries, {pair: margins[pair] for pair in surely})
        self._manager = pin.BroadPhaseManager_SSaPCollisionManager(
            self._model, self._clear.model, self._clear.data
        )

    def verdict(self, x: Array) -> bool | None:
        """Whether a configuration, (size,), is clear; None where hulls do not tell."""
        model, data = self._model, self._data
        if not pin.computeCollisions(model, data, self._manager, x, True):
            return True
        near = self._near
        pin.updateGeometryPlacements(model, data, near.model, near.data)
        return False if pin.computeCollisions(near.model, near.data, True) else None


class _Query:
    """Pairs with a margin each."""

    def __init__(self, geometries: Sequence[object], margins: dict[tuple[int, int], float]) -> None:
        self.model = pin.GeometryModel()
        for geometry in geometries:
            self.model.addGeometryObject(geometry)
        for pair in margins:
            self.model.addCollisionPair(pin.CollisionPair(int(pair[0]), int(pair[1])))
        self.data = pin.GeometryData(self.model)
        for request, margin in zip(self.data.collisionRequests, margins.values(), strict=True):
            request.security_margin = margin
            request.gjk_tolerance = request.epa_tolerance = _TOLERANCE
            # What was asked before must not matter.
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
            request.enable_contact = False


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
