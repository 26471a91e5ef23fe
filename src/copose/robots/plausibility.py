"""Implausible inertias and limits in a robot's file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.poses import Array, frozen_array
from copose.robots.arm import Joint, Oddity
from copose.robots.files.tree import Tree


@dataclass(frozen=True)
class PlausibilityOptions:
    """Bounds of what is plausible."""

    # Share by which the largest principal moment may exceed the sum of the other two, as files
    # round.
    triangle: float = 0.01
    negative: float = 1e-3  # share of the largest moment by which the smallest may be below zero
    zero: float = 1e-9  # m², moments per mass that are zero but for rounding
    # Moments as shares of an arm's mass times its longest link squared: of a mere frame, and of a
    # link too light to change what the arm can do.
    frame: float = 1e-5
    negligible: float = 1e-3
    # Size of a link with a mesh, or without shapes, by the distance of its joints, and by half the
    # longest of the arm: bodies reach beyond their joints, also where joints meet in a point.
    reach: float = 1.25
    repeated: int = 4  # links of one inertial, or joints of one limit, that are no chance
    largest: float = 1e5  # torque, N·m or N, and speed, rad/s or m/s


@dataclass(frozen=True, eq=False)
class _Inertial:
    """A link's inertial beside its size."""

    link: str
    mass: float  # kg
    moments: Array  # principal ones, ascending, kg·m², (3,)
    # Diagonal of the box round what is known of the link, or its distance from the link that it
    # hangs on, m.
    size: float
    bounded: bool  # whether that is all of it: it has shapes, and none is a mesh

    @property
    def gyration(self) -> float:
        """Largest radius of gyration, m."""
        return math.sqrt(self.moments[2] / self.mass)

    @property
    def excess(self) -> float:
        """Largest moment by the sum of the other two, at most 1 of any body."""
        return float(self.moments[2] / max(self.moments[0] + self.moments[1], 1e-300))


def negative_inertias(
    tree: Tree, links: Sequence[str], options: PlausibilityOptions = PlausibilityOptions()
) -> list[str]:
    """Sentences on links with moments of inertia below zero, which no body has."""
    return [
        f"the inertia of link {body.link!r} is negative: its principal moments are "
        f"{_listed(body.moments)} kg·m²"
        for body in _inertials(tree, links)
        if -body.moments[0] > max(options.negative * body.moments[2], options.zero * body.mass)
    ]


def inertia_oddities(
    tree: Tree, links: Sequence[str], options: PlausibilityOptions = PlausibilityOptions()
) -> tuple[Oddity, ...]:
    """Implausible inertials of the links that an arm moves."""
    between = (j.origin.position for j in tree.order if j.parent in links and j.child in links)
    longest = max((float(np.linalg.norm(offset)) for offset in between), default=0.0)
    texts = _oddities(_inertials(tree, links), longest, options)
    return tuple(Oddity("inertia", text) for text in texts)


def limit_oddities(
    joints: Sequence[Joint], options: PlausibilityOptions = PlausibilityOptions()
) -> tuple[Oddity, ...]:
    """Implausible torque and speed limits of an arm's joints."""
    oddities, most = [], options.largest
    efforts = [joint.effort for joint in joints]
    if len(joints) >= options.repeated and len(set(efforts)) == 1 and math.isfinite(efforts[0]):
        listed = ", ".join(f"{effort:g}" for effort in efforts)
        oddities.append(
            Oddity("effort", f"torque limits look like placeholders: {listed}, one for all joints")
        )
    oddities += _beyond("effort", "torque", {joint.name: joint.effort for joint in joints}, most)
    oddities += _beyond("speed", "speed", {joint.name: joint.velocity for joint in joints}, most)
    return tuple(oddities)


def _beyond(
    about: Literal["effort", "speed"], what: str, limits: Mapping[str, float], most: float
) -> Iterator[Oddity]:
    """A sentence on the limits that are larger than any robot's, if there are any."""
    huge = [
        f"the {what} limit of joint {name!r}, {limit:g}, is beyond any robot's"
        for name, limit in limits.items()
        if most < limit < math.inf
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


def _oddities(
    bodies: Sequence[_Inertial], longest: float, options: PlausibilityOptions
) -> Iterator[str]:
    """Sentences on the inertials of an arm, by the longest distance of its joints, m."""
    if len(bodies) >= options.repeated:
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
        if body.excess > 1 + options.triangle
        and body.moments[2] > max(options.frame * whole, options.zero * body.mass)
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
        size = body.size if body.bounded else options.reach * max(body.size, longest / 2)
        if body.moments[2] > options.negligible * whole and body.gyration > size > 0:
            text = (
                f"the inertia of link {body.link!r} is that of a larger body: its radius of "
                f"gyration is {body.gyration:.3g} m, the link's size about {size:.2g} m"
            )
            large.append((size / body.gyration, text))
    if large:
        yield _first([text for _, text in sorted(large)])


def _first(texts: Sequence[str]) -> str:
    """The first of some sentences, and the number of the others."""
    return texts[0] + (f" (and {len(texts) - 1} more)" if len(texts) > 1 else "")


def _listed(values: Array) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
