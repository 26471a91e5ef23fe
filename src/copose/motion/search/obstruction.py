"""Obstructions: why there is no motion, told by time, arm and what gives out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from copose.motion.dynamics.limit_use import LimitUse
from copose.motion.dynamics.rate_bounds import Outrun
from copose.motion.graph.roadmap import Roadmap
from copose.motion.graph.routes import RouteFinder
from copose.motion.nlp.motion_nlp import OptimisedMotion
from copose.motion.path.knots import Course
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.search.effort import EFFORTS
from copose.posture.search.heaviest import times
from copose.posture.setting import Setting
from copose.progress import StoppedError
from copose.self_motion.misses.branch_and_bound import excluded
from copose.self_motion.misses.nearest_miss import miss_of
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler


@dataclass(frozen=True)
class Obstruction:
    """The status of a problem without a motion, and why there is none."""

    status: Literal["infeasible", "failed"]
    reason: str


def _obstruction(reason: str, *, sure: bool) -> Obstruction:
    """No motion: infeasible for a reason that is sure, failed for one that a search came to."""
    return Obstruction("infeasible" if sure else "failed", reason)


def not_started(model: PostureModel, setting: Setting, i: int) -> Obstruction:
    """The start of arm i cannot be closed."""
    cell, arm = setting.cell, setting.cell.arms[i]
    sure = excluded(
        arm, model.arms[i], cell.lower[i], cell.upper[i], setting.placement.goals[i],
        rigid=cell.system.space.rigid,
    )  # fmt: skip
    why = f"arm {arm.name!r}, 0 s: its start could not be projected onto its grasp"
    return _obstruction(why + ("; no posture reaches it" if sure else ""), sure=sure)


def disconnected(
    model: PostureModel,
    course: Course,
    roadmap: Roadmap,
    i: int,
    duration: float,
    seed: int,
    *,
    surely: Callable[[], bool],
    drawn: int = 64,
) -> Obstruction:
    """An arm's postures end, or the moves between them.

    Args:
        model: what is built.
        course: the layers.
        roadmap: of the arm.
        i: the arm.
        duration: s.
        seed: of what is drawn.
        surely: tells whether moves end there however finely one looks.
        drawn: postures that are sampled where it ends.
    """
    reached, name = roadmap.reached(), model.cell.arms[i].name
    stop = next((k for k, mask in enumerate(reached) if not mask.any()), len(reached))
    if stop == len(course):
        sure = surely()
        come = "can come to" if sure else "was found to come to"
        return _obstruction(
            f"arm {name!r}, {duration:.3g} s: the posture that it has to end in is on another "
            f"branch than any that it {come} (branch)",
            sure=sure,
        )
    when = f"arm {name!r}, {_time(course, stop, duration)}"
    last = min(stop, len(course) - 1)
    goal, setting = course.goals[i][last], course.settings[last]
    effort = EFFORTS["normal"]
    sampler = ArmSampler(model.cell, model.arms[i], i, goal)
    rng = np.random.default_rng([seed, i, 1])
    sample = sampler.sample(rng, effort.batch, effort.batches, drawn, effort.insistence)
    if len(sample.closed):
        sure = surely()
        how = "can be" if sure else "was"
        return _obstruction(
            f"{when}: no posture there {how} come to from the beginning without letting go: "
            f"they are on other branches (branch){_stopping(model, roadmap, course, i, stop)}",
            sure=sure,
        )
    missed = miss_of(setting.cell, model.arms[i], setting.placement.goals[i], i, sample).sure
    return _obstruction(f"{when}: {_miss(model, i, goal, sample.missed)}", sure=missed)


def _miss(model: PostureModel, i: int, goal: Array, missed: Array) -> str:
    """The obstacle between an arm and its grasp: its reach, or a joint limit."""
    cell, kernels = model.cell, model.arms[i]
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


def _stopping(model: PostureModel, roadmap: Roadmap, course: Course, i: int, stop: int) -> str:
    """The joint whose limit ends the branch that goes farthest."""
    if stop == 0 or stop > len(roadmap.layers):
        return ""
    q = roadmap.layers[stop - 1].q[roadmap.reached()[stop - 1]]
    if not len(q):
        return ""
    cell, free = model.cell, np.full(q.shape[1], np.inf)
    ends, _ = project(model.arms[i], q, course.goals[i][stop], -free, free, steps=12)
    over = np.maximum(cell.lower[i] - ends, ends - cell.upper[i])
    nearest = over[over.max(axis=1).argmin()]
    if nearest.max() <= 0:
        return ""
    joint = cell.arms[i].joints[int(nearest.argmax())].name
    return f"; the one that it is on ends at the limit of joint {joint!r}"


def blocked(
    model: PostureModel, course: Course, finder: RouteFinder, duration: float
) -> Obstruction:
    """No combination of the arms' postures serves, though each arm alone goes through."""
    constraints = model.cell.problem.constraints
    what = " and ".join(
        (["keep the clearance"] if constraints.collision else [])
        + (["hold the object within the torque limits"] if constraints.static_torque else [])
        + ([] if constraints.collision or constraints.static_torque else ["have an objective"])
    )
    still = finder.values.object_in_the_way
    if still is not None:
        k, reason = still
        return _obstruction(f"{_time(course, k, duration)}: {reason} (collision)", sure=True)
    if finder.lattice is None:
        return Obstruction("failed", f"no motion was found whose postures all {what}")
    # What bodies leave may be narrower than the graph is fine: points alone are all known.
    sure = finder.single and not constraints.collision
    stop = min(finder.lattice.reach(), len(course) - 1)
    if model.cell.problem.path is not None and model.cell.problem.path.closed:
        what = "ends" if sure else "was found that ends"
        return _obstruction(
            f"no motion {what} in the posture that it begins with (branch)", sure=sure
        )
    names = ", ".join(repr(arm.name) for arm in model.cell.arms)
    none = f"no postures that can be reached here {what}"
    if not sure:
        none = f"no postures were found here that can be reached and {what}"
        if any(arm.start is not None for arm in model.cell.arms):
            none += "; another start, or none, may lead elsewhere"
    return _obstruction(f"arms {names}, {_time(course, stop, duration)}: {none}", sure=sure)


def too_fast(
    model: PostureModel, finder: RouteFinder, course: Course, duration: float, least: float
) -> Obstruction:
    """Joints would have to be faster than they can be; the shortest motion takes ``least``, s."""
    arm, joint, k = finder.slowest()
    name = model.cell.arms[arm]
    return _obstruction(
        f"arm {name.name!r}, {_time(course, k, duration)}: joint {name.joint_names[joint]!r} would "
        f"be faster than its limit; {duration:.3g} s is too short, about {least:.3g} s is not "
        "(speed)",
        sure=finder.single,
    )


def outpaced(model: PostureModel, course: Course, duration: float, grasp: Outrun) -> Obstruction:
    """A grasp moves faster than its arm can follow in any posture."""
    name = model.cell.arms[grasp.arm].name
    return _obstruction(
        f"arm {name!r}, {_time(course, grasp.knot, duration)}: its grasp goes {grasp.asked:.3g} "
        f"{grasp.unit}, and its joints at their limits bring it along with {grasp.most:.3g} at "
        f"most, whatever the posture; {duration:.3g} s is too short ({grasp.what})",
        sure=True,
    )


def uncarried(model: PostureModel, course: Course, k: int, duration: float) -> Obstruction:
    """Nothing that the contacts exert holds or moves the object as the path has it at layer k."""
    names = ", ".join(repr(arm.name) for arm in model.cell.arms)
    return Obstruction(
        "infeasible",
        f"arms {names}, {_time(course, k, duration)}: the contacts cannot carry the object, "
        "whatever their forces: hinges and ball joints leave it free to turn (contact)",
    )


def unheld(course: Course, k: int, duration: float, reason: str, *, sure: bool) -> Obstruction:
    """No posture at all holds the object at layer k, for a reason."""
    path = course.settings[0].cell.problem.path
    timeless = path is not None and path.duration == "shortest"
    when = _pose(k) if timeless and k in (0, len(course) - 1) else _time(course, k, duration)
    return _obstruction(f"{when}: {reason} (torque)", sure=sure)


def dropped(model: PostureModel, k: int, shares: Array) -> Obstruction:
    """The posture that a motion has to begin or to end in, at knot k, does not hold the object at
    rest: shares of torque limits, (N,), the largest at its least.
    """
    i, j = model.cell.joint(int(shares.argmax()))
    arm = model.cell.arms[i]
    return _obstruction(
        f"arm {arm.name!r}, {_pose(k)}: in the posture given joint {arm.joint_names[j]!r} "
        f"needs {times(float(shares.max()))} times its torque limit to hold the object at rest "
        "(torque)",
        sure=True,
    )


def overloaded(
    model: PostureModel, course: Course, duration: float, strain: LimitUse, *, judged: int = 0
) -> Obstruction:
    """Even the motion that spares limits most breaks one.

    Args:
        model: whose arms they are.
        course: on which the strain is told.
        duration: s.
        strain: of the motion that spares the limits most.
        judged: how many motions there are, where they are all known.
    """
    arm = model.cell.arms[strain.arm]
    joint, share = arm.joint_names[strain.joint], f"{times(strain.times)} times its"
    told = {
        "hold": f"joint {joint!r} needs {share} torque limit to hold the object (torque)",
        "torque": f"joint {joint!r} needs {share} torque limit (torque)",
        "acceleration": f"joint {joint!r} takes {share} acceleration limit (acceleration)",
    }
    which = "in the motion found that spares it most"
    if judged:
        which = f"in the best of all {judged} motions that there are"
    return _obstruction(
        f"arm {arm.name!r}, {_time(course, strain.knot, duration)}: even {which} "
        f"{told[strain.what]}",
        sure=judged > 0,
    )


def unfound(stop: StoppedError) -> Obstruction:
    """The planner had to end before it found a motion."""
    return Obstruction("failed", f"{stop}: no motion was found yet")


def program_failed(motion: OptimisedMotion) -> Obstruction:
    """The program of the most promising route failed: no proof that there is no motion."""
    name, knot, by = motion.violated
    when = motion.duration * knot / max(len(motion.q) - 1, 1)
    where = f", {when:.3g} s: {name} broken by {by:.2g}" if name else ""
    return Obstruction(
        "failed",
        "no route through the graph became a motion that keeps all constraints; the program of the "
        f"most promising ended with {motion.status}{where}",
    )


def opens(error: float, count: int) -> Obstruction:
    """The chain opens between knots, however many there are: the motion jumps there."""
    return Obstruction(
        "failed",
        f"between knots the chain opens by {error:.2g} m or rad even with {count} of them; a "
        "larger smoothness, or speed limits, keep joints from jumping",
    )


def _pose(k: int) -> str:
    """The end of a path at knot k, whose time is not known yet."""
    return "the first pose" if k == 0 else "the last pose"


def _time(course: Course, k: int, duration: float) -> str:
    return f"{duration * course.phases[min(k, len(course) - 1)]:.3g} s"
