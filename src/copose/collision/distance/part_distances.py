"""Distances of two parts of solids by coal: of their convex hulls, and of the parts themselves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from copose.collision.distance.paired_solids import PartPoses, PlacedPart
from copose.poses import Array


@dataclass(frozen=True)
class DistanceOptions:
    """Accuracy of coal's distances."""

    # Relative tolerances of GJK and EPA, each tried where those before do not converge.
    tolerances: tuple[float, ...] = (1e-10, 1e-6, 1e-4)
    deepest: float = 1e6  # m; a larger depth tells that EPA has not converged
    touching: float = 1e-9  # m, distance of surfaces below which the normal is that of the hulls


class PartGap(NamedTuple):
    """The distance of two parts and where it is taken."""

    distance: float  # m; where they overlap −(the depth of their hulls)
    a: Array  # the point of the one in the world, (3,)
    b: Array  # the point of the other in the world, (3,)
    normal: Array  # unit, from the one to the other, (3,)


@dataclass(frozen=True, eq=False)
class PartDistances:
    """Distance queries of two parts, each independent of those before it.

    coal's functors are made anew for each query: what one was asked before changes the last digits
    of its answers.
    """

    clearance: float  # kept by parts, m
    options: DistanceOptions = DistanceOptions()

    def hull_distance(self, one: PlacedPart, other: PlacedPart, places: PartPoses) -> float:
        """Distance of the convex hulls of two parts, m; below zero how deep they overlap."""
        return self._measured(one.shape.bound, other.shape.bound, places(one), places(other))[0]

    def hull_gap(self, one: PlacedPart, other: PlacedPart, places: PartPoses) -> PartGap:
        """Distance of the convex hulls of two parts, its points and normal."""
        distance, result = self._measured(
            one.shape.bound, other.shape.bound, places(one), places(other)
        )
        return PartGap(distance, *_points(result), result.normal)

    def gap(self, one: PlacedPart, other: PlacedPart, places: PartPoses) -> PartGap:
        """Distance of two parts, its points and normal.

        A mesh is only a surface to coal, which tells no depth where two surfaces cross; hulls do.
        """
        if not (one.shape.hollow or other.shape.hollow):
            return self.hull_gap(one, other, places)
        distance, result = self._measured(
            one.shape.coal, other.shape.coal, places(one), places(other)
        )
        if distance > self.options.touching and not self.enclosed(one, other, places):
            a, b = _points(result)
            return PartGap(distance, a, b, (b - a) / np.linalg.norm(b - a))
        gap = self.hull_gap(one, other, places)
        return gap._replace(distance=min(gap.distance, 0.0))

    def hulls_within(
        self, one: PlacedPart, other: PlacedPart, most: float, places: PartPoses
    ) -> bool:
        """True where the hulls of two parts are nearer than a distance, m, to coal's accuracy."""
        import coal

        request, result = _request(most + self.options.tolerances[1]), coal.CollisionResult()
        a, b = one.shape.bound, other.shape.bound
        return bool(coal.collide(a, places(one), b, places(other), request, result) > 0)

    def keep_clear(
        self, one: PlacedPart, other: PlacedPart, hull_gap: float, places: PartPoses
    ) -> bool:
        """True where two parts keep the clearance, whose hulls are nearer: ``hull_gap``, m."""
        import coal

        functor = coal.ComputeCollision(one.shape.coal, other.shape.coal)
        result = coal.CollisionResult()
        near = functor(places(one), places(other), self._margin, result) > 0
        return not near and not (hull_gap <= 0 and self.enclosed(one, other, places))

    def enclosed(self, one: PlacedPart, other: PlacedPart, places: PartPoses) -> bool:
        """True where a mesh encloses the other of two parts, whose surfaces do not cross."""
        for outer, inner in ((one, other), (other, one)):
            if outer.shape.hollow:
                (R, p), (S, q) = outer.at(places.where), inner.at(places.where)
                if outer.shape.encloses(R.T @ (S @ inner.shape.witness + q - p)):
                    return True
        return False

    def _measured(self, one: Any, other: Any, place: Any, other_place: Any) -> tuple[float, Any]:
        """Distance of two of coal's shapes at their places, m, and coal's result."""
        import coal

        functor = coal.ComputeDistance(one, other)
        for request in self._requests:
            result = coal.DistanceResult()
            distance = functor(place, other_place, request, result)
            # EPA may not reach the smallest tolerance where round bodies overlap.
            if distance > -self.options.deepest:
                break
        return distance, result

    @cached_property
    def _requests(self) -> list[Any]:
        """Requests for distances, to be tried in order until one converges."""
        import coal

        requests = []
        for tolerance in self.options.tolerances:
            request = coal.DistanceRequest()
            request.gjk_tolerance = request.epa_tolerance = tolerance
            request.enable_signed_distance = True
            requests.append(request)
        return requests

    @cached_property
    def _margin(self) -> Any:
        """A request for whether shapes are nearer than the clearance."""
        import coal

        request = coal.CollisionRequest()
        request.security_margin, request.enable_contact = self.clearance, False
        request.gjk_tolerance = request.epa_tolerance = self.options.tolerances[0]
        return request


@lru_cache(maxsize=16)
def _request(margin: float) -> Any:
    """A request for whether shapes are nearer than a margin, m."""
    import coal

    request = coal.CollisionRequest()
    request.security_margin, request.enable_contact = margin, False
    request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
    return request


def _points(result: Any) -> tuple[Array, Array]:
    """The nearest points in one of coal's results, (3,) each."""
    return result.getNearestPoint1(), result.getNearestPoint2()
