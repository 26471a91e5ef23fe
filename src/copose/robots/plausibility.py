"""Numbers in a robot's file that no robot has."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.poses import Array, frozen_array
from copose.robots.arm import Joint, Oddity
from copose.robots.tree import Tree

# Part by which the largest principal moment may exceed the sum of the other two: files round.
_TRIANGLE_SLACK = 0.01
# Part of the largest principal moment that the smallest may be below zero: files round.
_ROUNDING = 1e-3
# Moments per mass, m², that are zero but for their last binary digit.
_NOTHING = 1e-9
# Moments as parts of an arm's mass times its longest link squared: what only a frame has, which
# matters to nobody, and what is too small to change what the arm can do.
_FRAME = 1e-5
_NEGLIGIBLE = 1e-3
# Size of a link with a mesh, or without shapes, by the way between its joints, and by half the
# longest of its arm: bodies reach beyond their joints, and have one where joints meet in a point.
_REACH = 1.25
# Links of one mass or one inertia, and joints of one torque limit, that are too many for chance.
_MANY = 4
# Torques, N·m or N, and speeds, rad/s or m/s, beyond those of any robot.
_BEYOND = 1e5


@dataclass(frozen=True, eq=False)
class _Inertial:
    """A link's inertial beside its size.

    Attributes:
        link: its name.
        mass: kg.
        moments: principal ones, ascending, kg·m², (3,).
        size: diagonal of the box round what is known of the link, or how far it is from the link
            that it hangs on, m.
        bounded: whether that is all of it: it has shapes, and none is a mesh.
    """

    link: str
    mass: float
    moments: Array
    size: float
    bounded: bool

    @property
    def gyration(self) -> float:
        """Largest radius of gyration, m."""
        return math.sqrt(self.moments[2] / self.mass)

    @property
    def excess(self) -> float:
        """Largest moment by the sum of the other two, at most 1 of any body."""
        return float(self.moments[2] / max(self.moments[0] + self.moments[1], 1e-300))


def negative_inertias(tree: Tree, links: Sequence[str]) -> list[str]:
    """Why mechanics makes no sense with some of a robot's links: moments of inertia below zero."""
    return [
        f"the inertia of link {body.link!r} is negative: its principal moments are "
        f"{_listed(body.moments)} kg·m²"
        for body in _inertials(tree, links)
        if -body.moments[0] > max(_ROUNDING * body.moments[2], _NOTHING * body.mass)
    ]


def inertia_oddities(tree: Tree, links: Sequence[str]) -> tuple[Oddity, ...]:
    """What no robot has of the inertials of the links that an arm moves."""
    between = (j.origin.position for j in tree.order if j.parent in links and j.child in links)
    longest = max((float(np.linalg.norm(offset)) for offset in between), default=0.0)
    texts = _oddities(_inertials(tree, links), longest)
    return tuple(Oddity("inertia", text) for text in texts)


def limit_oddities(joints: Sequence[Joint]) -> tuple[Oddity, ...]:
    """What no robot has of the torque and speed limits of an arm's joints."""
    oddities = []
    efforts = [joint.effort for joint in joints]
    if len(joints) >= _MANY and len(set(efforts)) == 1 and math.isfinite(efforts[0]):
        listed = ", ".join(f"{effort:g}" for effort in efforts)
        oddities.append(
            Oddity("effort", f"torque limits look like placeholders: {listed}, one for all joints")
        )
    oddities += _beyond("effort", "torque", {joint.name: joint.effort for joint in joints})
    oddities += _beyond("speed", "speed", {joint.name: joint.velocity for joint in joints})
    return tuple(oddities)


def _beyond(
    about: Literal["effort", "speed"], what: str, limits: Mapping[str, float]
) -> Iterator[Oddity]:
    huge = [
        f"the {what} limit of joint {name!r}, {limit:g}, is beyond any robot's"
        for name, limit in limits.items()
        if _BEYOND < limit < math.inf
    ]
    if huge:
        yield Oddity(about, _first(huge))


def _inertials(tree: Tree, links: Sequence[str]) -> list[_Inertial]:
    """The inertials of those of some links that have a mass."""
    ends: dict[str, list[Array]] = {link: [np.zeros(3)] for link in links}
    for joint in tree.order:
        if joint.parent in ends:
            ends[joint.parent].append(joint.origin.position)
    inertials = []
    for link in links:
        body = tree.links[link].body
        if body is not None and body.mass > 0:
            back = float(np.linalg.norm(tree.joints[link].origin.position))
            known = np.vstack([*ends[link], body.com, tree.links[link].outline])
            size = float(np.linalg.norm(np.ptp(known, axis=0)))
            moments = frozen_array(np.linalg.eigvalsh(body.inertia))
            bounded = tree.links[link].bounded
            inertials.append(_Inertial(link, body.mass, moments, max(size, back), bounded))
    return inertials


def _oddities(bodies: Sequence[_Inertial], longest: float) -> Iterator[str]:
    """Sentences on the inertials of an arm whose joints are at most so far apart, m."""
    if len(bodies) >= _MANY:
        if len({body.mass for body in bodies}) == 1:
            yield f"all links have one mass, {bodies[0].mass:g} kg, as placeholders do"
        if np.allclose([body.moments for body in bodies], bodies[0].moments, rtol=1e-6, atol=0):
            yield (
                "all links have one inertia, as placeholders do: principal moments "
                f"{_listed(bodies[0].moments)} kg·m²"
            )
    whole = sum(body.mass for body in bodies) * longest**2
    broken = [
        body
        for body in bodies
        if body.excess > 1 + _TRIANGLE_SLACK
        and body.moments[2] > max(_FRAME * whole, _NOTHING * body.mass)
    ]
    if broken:
        broken.sort(key=lambda body: -body.excess)
        yield _first(
            [
                f"the inertia of link {body.link!r} breaks the triangle inequality: its principal "
                f"moments are {_listed(body.moments)} kg·m²"
                for body in broken
            ]
        )
    large = []
    for body in bodies:
        size = body.size if body.bounded else _REACH * max(body.size, longest / 2)
        if body.moments[2] > _NEGLIGIBLE * whole and body.gyration > size > 0:
            text = (
                f"the inertia of link {body.link!r} is that of a larger body: its radius of "
                f"gyration is {body.gyration:.3g} m, the link's size about {size:.2g} m"
            )
            large.append((size / body.gyration, text))
    if large:
        yield _first([text for _, text in sorted(large)])


def _first(texts: Sequence[str]) -> str:
    """The first of some sentences, and how many more there are."""
    return texts[0] + (f" (and {len(texts) - 1} more)" if len(texts) > 1 else "")


def _listed(values: Array) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
