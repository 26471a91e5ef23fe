"""Notes that a reader of the numbers should know before trusting them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from copose.capability.torque_limits import Extreme
from copose.cell.cell import Cell
from copose.poses import Array
from copose.progress import StoppedError


@dataclass(frozen=True)
class Plausible:
    """Numbers beyond which a note is due."""

    acceleration: float = 100.0  # rad/s² or m/s², at which no robot's joint lasts
    effort: float = 1000.0  # N·m or N, more than an arm's joint has


def once(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes of one kind, which differ only in what they name, as one that names all."""
    kinds: dict[tuple[str, ...], list[list[str]]] = {}
    for note in dict.fromkeys(notes):
        first, *rest = re.split(r"(?<!\w)'([^']*)'(?!\w)", note)
        kinds.setdefault((first, *rest[1::2]), []).append(rest[::2])
    told = []
    for words, names in kinds.items():
        text = words[0]
        for named, word in zip(zip(*names, strict=True), words[1:], strict=True):
            several = dict.fromkeys(map(repr, named))
            text = re.sub(r"\b(arm|link|joint) $", r"\1s " if len(several) > 1 else r"\g<0>", text)
            text += ", ".join(several) + word
        told.append(text)
    return tuple(told)


def best_so_far(stop: StoppedError) -> str:
    """The note that a call had to end before it was done."""
    return (
        f"{stop}: the best so far; answers that are cut short may differ from run to run: allow "
        "more time for one that does not"
    )


def standing_notes(cell: Cell, *, everything: bool = False) -> tuple[str, ...]:
    """Notes that hold for every posture of a cell.

    With ``everything`` also those on what its answers do not depend on.
    """
    return once([*_unit_notes(cell), *_model_notes(cell), *_oddities(cell, everything)])


def _unit_notes(cell: Cell) -> list[str]:
    """Notes on numbers that depend on the unit of length, or add newtons to newton-metres."""
    space, settings, notes = cell.system.space, cell.problem.ellipsoid, []
    axes, objective = cell.problem.axes, cell.problem.objective
    # What torque limits decide has no unit ball, and no pseudoinverse.
    constraints = cell.problem.constraints
    limited = objective.torque_limited
    why = []
    mixed = set(axes) & set(space.linear) and set(axes) & set(space.angular)
    if mixed and objective.adds_coordinates and not limited:
        why.append("mixed axes")
    shares = objective.shares_load or (
        cell.resolution.name == "pseudoinverse" and not objective.kinematic and not limited
    )
    shared = space.rigid and len(cell.arms) > 1 and shares
    if shared and settings.load_distribution == "moore-penrose":
        why.append("Moore–Penrose")
    if why:
        notes.append(f"unit of length matters ({', '.join(why)}): copose manual measures")
    if not space.rigid:
        notes.append(
            "contacts transmit forces only: the ellipsoid ignores the moments that they exert on "
            "the object, which may spin"
            + ("; acceleration, payload and static_torque do not" if limited else "")
            + f"; [task] space = {space.name.removesuffix('-linear')!r} holds it rigidly"
        )
    twisted = [arm.name for arm in cell.problem.arms if arm.freedom.grasp.twist is not None]
    if twisted and not space.rigid:
        notes.append(
            f"the twist of the grasp of {', '.join(twisted)} has no effect: contacts of space "
            f"{space.name!r} hold no orientation; leave it out"
        )
    if np.any(cell.velocity) and (limited or constraints.static_torque):
        notes.append("what torque limits allow is told of rest; leave out object.velocity")
    grips = [grip for arm in cell.problem.arms for grip in (arm.grip.force, arm.grip.moment)]
    if constraints.internal_force is not None or any(grip is not None for grip in grips):
        notes.append(
            "limits of contact wrenches are kept by polyhedra inside the balls of their norms: up "
            "to 3 % less in space, 0.5 % in the plane; give them so much larger to use them whole"
        )
    sliding = [
        f"{arm.name}/{joint.name}"
        for arm in cell.arms
        for joint in arm.joints
        if joint.kind == "prismatic"
    ]
    if sliding and settings.torque_scaling == "unit":
        notes.append(
            f"unit torques count 1 N like 1 N·m at the prismatic joint {sliding[0]}; "
            "torque_scaling = 'limits' does not"
        )
    spare = sliding and any(
        arm.n > space.m and any(joint.kind == "prismatic" for joint in arm.joints)
        for arm in cell.arms
    )
    if spare and (cell.resolution.name == "pseudoinverse" or np.any(cell.velocity)):
        notes.append(
            f"least-norm joint motion adds m to rad at the prismatic joint {sliding[0]} and so "
            "depends on the unit of length; resolution = 'torque-optimal' at rest does not"
        )
    if settings.gravity and not np.any(cell.gravity):
        notes.append("gravity = true, but [world] gravity is 0: set one of the two")
    return notes


def _model_notes(cell: Cell) -> list[str]:
    """Notes on what the robots' files leave out or may have wrong."""
    notes = [note for arm in cell.arms for note in arm.notes]
    notes += [
        f"no dynamic ellipsoid, and nothing of torques, is known: arm {name!r}: {why}; "
        "correct its file, or ask for 'velocity-volume' or 'force-volume'"
        for name, why in cell.weightless.items()
    ]
    ungeared = [arm.name for arm in cell.arms if not arm.geared and arm.name not in cell.weightless]
    if ungeared:
        notes.append(f"gears are ignored: no [[arms]] armature is given for {', '.join(ungeared)}")
    for arm in cell.arms:
        notes += [
            f"joint {joint.name!r} of arm {arm.name!r} is locked at {joint.position:g}, outside "
            f"its limits {joint.lower:g} … {joint.upper:g}; `locked` holds it elsewhere"
            for joint in arm.locked
            if not joint.lower - 1e-6 <= joint.position <= joint.upper + 1e-6
        ]
        huge = max(joint.effort for joint in arm.joints) >= Plausible().effort
        told = any(oddity.about == "effort" for oddity in arm.oddities)
        if cell.problem.ellipsoid.torque_scaling == "limits" and huge and not told:
            notes.append(
                f"the torque limits of arm {arm.name!r} look like placeholders: "
                + ", ".join(f"{joint.effort:g}" for joint in arm.joints)
                + f"; {_cure('effort')}"
            )
    return notes


def _cure(about: str) -> str:
    """The cure for a doubtful number of a robot's file."""
    return {
        "inertia": "correct it in the robot's file",
        "effort": "[[arms]] torque_limits gives others",
        "speed": "[[arms]] velocity_limits gives others",
    }[about]


def _oddities(cell: Cell, everything: bool) -> Iterator[str]:
    """Notes on numbers of the robots' files that no robot has."""
    concerns = {"inertia": not cell.problem.kinematic, "effort": cell.torque_limits is not None}
    for arm in cell.arms:
        for oddity in arm.oddities:
            if everything or concerns.get(oddity.about, cell.problem.path is not None):
                yield f"arm {arm.name!r}: {oddity.text}; {_cure(oddity.about)}"


def margin_notes(cell: Cell, joints: Sequence[Array]) -> tuple[str, ...]:
    """Notes on arms of a posture that are nearer to a limit than joint_margin."""
    parts = zip(cell.arms, joints, cell.lower, cell.upper, strict=True)
    return tuple(
        f"within joint_margin of a limit: arm {arm.name!r}; move it, or lower joint_margin"
        for arm, q, lower, upper in parts
        if np.any((q < lower) | (q > upper))
    )


def extreme_notes(cell: Cell, postures: Sequence[Mapping[str, Extreme]]) -> tuple[str, ...]:
    """Notes on extremes that torque limits allow, by name, at each of some postures."""
    extremes = [each for posture in postures for each in posture.items()]
    return (*_quick_notes(cell, extremes), *_contact_notes(cell, extremes))


def _quick_notes(cell: Cell, extremes: Sequence[tuple[str, Extreme]]) -> list[str]:
    """A note on joint accelerations that no motion keeps up."""
    most = Plausible().acceleration
    joints = [(arm.name, joint) for arm in cell.arms for joint in arm.joints]
    moved = [(name, np.abs(np.concatenate(each.accelerations))) for name, each in extremes]
    quick = [(name, sizes) for name, sizes in moved if sizes.max() > most]
    if not quick:
        return []
    name, sizes = max(quick, key=lambda each: float(each[1].max()))
    arm, joint = joints[int(sizes.argmax())]
    unit = "m/s²" if joint.kind == "prismatic" else "rad/s²"
    counted = f"; beyond {most:g} in {len(quick)} extremes" if len(quick) > 1 else ""
    return [
        f"joint accelerations reach {sizes.max():,.0f} {unit} ({arm}/{joint.name}, {name}{counted})"
        ": what torques can do in an instant, not what a motion can keep up (copose manual torques)"
    ]


def _contact_notes(cell: Cell, extremes: Sequence[tuple[str, Extreme]]) -> list[str]:
    """Notes on contacts that no grip limits."""
    limited = cell.problem.constraints.internal_force is not None
    loose = [i for i, arm in enumerate(cell.problem.arms) if not limited and arm.grip.endless]
    if not loose or not extremes:
        return []
    said = []
    space = cell.system.space
    for rows, unit in ((list(space.linear), "N"), (list(space.angular), "N·m")):
        if rows:
            sizes = {(name, i): float(np.linalg.norm(each.wrenches[i][rows]))
                     for name, each in extremes for i in loose}  # fmt: skip
            name, i = max(sizes, key=lambda key: sizes[key])
            said.append(f"{sizes[name, i]:,.4g} {unit} (arm {cell.arms[i].name!r}, {name})")
    return [
        "contacts without a grip are taken as unbreakable ([[arms]] grip limits them): here up to "
        + " and ".join(said)
    ]
