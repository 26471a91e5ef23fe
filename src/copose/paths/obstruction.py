"""What keeps a motion from going on: when, which arm, and what gives out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.paths.course import Course
from copose.paths.roadmap import Roadmap
from copose.paths.routes import Finder
from copose.paths.solving import Shaped
from copose.paths.straining import Strain
from copose.planning.closing import CLOSED, project
from copose.planning.machinery import Machinery
from copose.planning.search import EFFORTS
from copose.planning.self_motion import ArmSampler
from copose.poses import Array

_DRAWN = 64


@dataclass(frozen=True)
class Obstruction:
    """Why there is no motion."""

    status: Literal["infeasible", "failed"]
    reason: str


def not_started(arm: str) -> Obstruction:
    """An arm's start holds nothing."""
    return Obstruction(
        "infeasible", f"arm {arm!r}, 0 s: its start could not be projected onto its grasp"
    )


def disconnected(
    machinery: Machinery, course: Course, roadmap: Roadmap, i: int, duration: float, seed: int
) -> Obstruction | None:
    """Where an arm's postures end, or their moves; None where some go through."""
    reached, name = roadmap.reached(), machinery.cell.arms[i].name
    stop = next((k for k, mask in enumerate(reached) if not mask.any()), len(reached))
    if stop == len(course):
        last = roadmap.held[1]
        if last is None or reached[-1][last]:
            return None
        return Obstruction(
            "infeasible",
            f"arm {name!r}, {duration:.3g} s: the posture that it has to end in is on another "
            "branch than any that it can come to (branch)",
        )
    when = f"arm {name!r}, {_time(course, stop, duration)}"
    goal = course.goals[i][min(stop, len(course) - 1)]
    effort = EFFORTS["normal"]
    sampler = ArmSampler(machinery.cell, machinery.arms[i], i, goal)
    rng = np.random.default_rng([seed, i, 1])
    sample = sampler.sample(rng, effort.batch, effort.batches, _DRAWN, effort.insistence)
    if len(sample.closed):
        return Obstruction(
            "infeasible",
            f"{when}: no posture there can be come to from the beginning without letting go: "
            f"they are on other branches (branch){_stopping(machinery, roadmap, course, i, stop)}",
        )
    return Obstruction("infeasible", f"{when}: {_miss(machinery, i, goal, sample.missed)}")


def _miss(machinery: Machinery, i: int, goal: Array, missed: Array) -> str:
    """Which of reach and joint limits keeps an arm from its grasp."""
    cell, kernels = machinery.cell, machinery.arms[i]
    residual, _ = kernels.residual(missed[:1], goal)
    by = 1e3 * float(np.linalg.norm(residual[0, : len(cell.system.space.linear)]))
    free = np.full(kernels.n, np.inf)
    ends, gaps = project(kernels, missed, goal, -free, free)
    closed = ends[gaps <= CLOSED]
    if not len(closed):
        return f"it misses its grasp by {by:.3g} mm at best (reach)"
    folded = cell.folded(i, closed)
    over = np.maximum(cell.lower[i] - folded, folded - cell.upper[i])
    nearest = over[over.max(axis=1).argmin()]
    joint = cell.arms[i].joints[int(nearest.argmax())].name
    return f"joint {joint!r} would be {nearest.max():.3g} beyond its limits (limit)"


def _stopping(machinery: Machinery, roadmap: Roadmap, course: Course, i: int, stop: int) -> str:
    """The joint whose limit ends the branch that goes farthest."""
    if stop == 0 or stop > len(roadmap.layers):
        return ""
    q = roadmap.layers[stop - 1].q[roadmap.reached()[stop - 1]]
    if not len(q):
        return ""
    cell, free = machinery.cell, np.full(q.shape[1], np.inf)
    ends, _ = project(machinery.arms[i], q, course.goals[i][stop], -free, free, steps=12)
    over = np.maximum(cell.lower[i] - ends, ends - cell.upper[i])
    nearest = over[over.max(axis=1).argmin()]
    if nearest.max() <= 0:
        return ""
    joint = cell.arms[i].joints[int(nearest.argmax())].name
    return f"; the one that it is on ends at the limit of joint {joint!r}"


def blocked(
    machinery: Machinery,
    course: Course,
    finder: Finder,
    duration: float,
) -> Obstruction:
    """Where no combination of the arms' postures serves, though each arm alone goes through."""
    constraints = machinery.cell.problem.constraints
    what = " and ".join(
        (["keep the clearance"] if constraints.collision else [])
        + (["hold the object within the torque limits"] if constraints.static_torque else [])
        + ([] if constraints.collision or constraints.static_torque else ["have an objective"])
    )
    if finder.lattice is None:
        return Obstruction("failed", f"no motion was found whose postures all {what}")
    # What bodies leave may be narrower than the graph is fine: only nothing at all is sure.
    left = [np.isfinite(values).any() for values in finder.lattice.values]
    narrow = constraints.collision and all(left)
    stop = min(finder.lattice.reach(), len(course) - 1)
    if machinery.cell.problem.path is not None and machinery.cell.problem.path.closed:
        return Obstruction(
            "infeasible", "no motion ends in the posture that it begins with (branch)"
        )
    names = ", ".join(repr(arm.name) for arm in machinery.cell.arms)
    return Obstruction(
        "failed" if narrow else "infeasible",
        f"arms {names}, {_time(course, stop, duration)}: no postures that can be come to {what}",
    )


def too_fast(
    machinery: Machinery, finder: Finder, course: Course, duration: float, least: float
) -> Obstruction:
    """That joints would have to be faster than they can be; the shortest motion found takes
    ``least``, s.
    """
    arm, joint, k = finder.slowest()
    name = machinery.cell.arms[arm]
    return Obstruction(
        "infeasible",
        f"arm {name.name!r}, {_time(course, k, duration)}: joint {name.joint_names[joint]!r} would "
        f"be faster than its limit; {duration:.3g} s is too short, about {least:.3g} s is not "
        "(speed)",
    )


def uncarried(machinery: Machinery, course: Course, k: int, duration: float) -> Obstruction:
    """Nothing that the contacts exert holds or moves the object as the path has it at layer k."""
    names = ", ".join(repr(arm.name) for arm in machinery.cell.arms)
    return Obstruction(
        "infeasible",
        f"arms {names}, {_time(course, k, duration)}: the contacts cannot carry the object, "
        "whatever their forces: hinges and ball joints leave it free to turn (contact)",
    )


def unheld(course: Course, k: int, duration: float, reason: str) -> Obstruction:
    """No posture at all holds the object at layer k, for a reason."""
    return Obstruction("infeasible", f"{_time(course, k, duration)}: {reason} (torque)")


def overloaded(
    machinery: Machinery, course: Course, duration: float, strain: Strain, *, sure: bool
) -> Obstruction:
    """What limit the motions that spare them most still break, and by how much at best."""
    arm = machinery.cell.arms[strain.arm]
    joint, times = arm.joint_names[strain.joint], f"{strain.times:.3g} times its"
    told = {
        "hold": f"joint {joint!r} needs {times} torque limit to hold the object (torque)",
        "torque": f"joint {joint!r} needs {times} torque limit (torque)",
        "acceleration": f"joint {joint!r} takes {times} acceleration limit (acceleration)",
    }
    return Obstruction(
        "infeasible" if sure else "failed",
        f"arm {arm.name!r}, {_time(course, strain.knot, duration)}: even in the motion found that "
        f"spares it most {told[strain.what]}",
    )


def program_failed(found: Shaped) -> Obstruction:
    """How the program of the most promising route ended: no proof that there is no motion."""
    name, knot, by = found.violated
    when = found.duration * knot / max(len(found.q) - 1, 1)
    where = f", {when:.3g} s: {name} broken by {by:.2g}" if name else ""
    return Obstruction(
        "failed",
        "no route through the graph became a motion that keeps all constraints; the program of the "
        f"most promising ended with {found.status}{where}",
    )


def opens(error: float, count: int) -> Obstruction:
    """The chain opens between knots, however many there are: the motion jumps there."""
    return Obstruction(
        "failed",
        f"between knots the chain opens by {error:.2g} m or rad even with {count} of them; a "
        "larger smoothness, or speed limits, keep joints from jumping",
    )


def _time(course: Course, k: int, duration: float) -> str:
    return f"{duration * course.phases[min(k, len(course) - 1)]:.3g} s"
