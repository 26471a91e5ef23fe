"""A first problem file for robots: arms, bases, the object's place, and grasps are guessed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from copose.cell.cell import Cell
from copose.collision.links.link_shapes import LinkShapes
from copose.errors import InputError, nearest
from copose.kernels import one_at_a_time
from copose.loader import parse
from copose.objectives.registry import objective_of
from copose.poses import Array, Pose
from copose.posture.start_postures import starts
from copose.progress import stage
from copose.robots import Arm, ArmStart
from copose.self_motion.kernels import ArmKernels
from copose.setup.chains import ChainOptions
from copose.setup.grasps import GraspedObject, Hand, choose
from copose.setup.layout import Reach, bases, places
from copose.setup.problem_writer import GuessedBox, Wishes, Writer, number
from copose.setup.robot_entries import NamedArm, RobotEntry, named_arms


@dataclass(frozen=True, eq=False)
class Draft:
    """A first problem file."""

    text: str
    guesses: tuple[str, ...]  # what was guessed, in words
    starts: tuple[ArmStart, ...]  # the arms where the file has them, or as near as they come


def default_name(robots: Sequence[str]) -> str:
    """The name of a problem of some robots: ``baxter``, ``two-panda``, ``panda-ur5``."""
    stems = [Path(robot).stem for robot in robots]
    if len(stems) > 1 and len({*stems}) == 1:
        count = {2: "two", 3: "three", 4: "four"}.get(len(stems), len(stems))
        return f"{count}-{stems[0]}"
    return "-".join(stems)[:60]


@one_at_a_time
def draft(robots: Sequence[str], file: Path, wishes: Wishes) -> Draft:
    """A problem of robots, as `RobotEntry.of` takes them, around one object, for a file: every
    guess of it has a comment, and what is wished is not guessed.

    Raises:
        InputError: a robot cannot be used, or has no arms, or a wish does not fit.
    """
    entries = [RobotEntry.of(robot, file.parent) for robot in robots]
    arms = named_arms(entries, wishes.tips)
    space = wishes.space or _space(arms)
    cell = _cell(entries, arms, space, file)
    taught = _taught(cell, wishes.joints)
    shapes = {k: LinkShapes.of(entry.robot, measured=True) for k, entry in enumerate(entries)}
    hands = [
        Hand.of(entries[arm.robot].robot, shapes[arm.robot], chain, arm.locked)
        for arm, chain in zip(arms, cell.arms, strict=True)
    ]
    reaches = [Reach.of(arm) for arm in cell.arms]
    by_robot = [
        [reach for reach, arm in zip(reaches, arms, strict=True) if arm.robot == k]
        for k in range(len(entries))
    ]
    stands = bases(by_robot)
    standing = tuple(
        replace(chain, base=stands[arm.robot]) for arm, chain in zip(arms, cell.arms, strict=True)
    )
    shortest = min(reach.length for reach in reaches)
    size = np.array(wishes.size) if wishes.size is not None else _box(shortest, GuessedBox())
    if taught is not None:
        holding = _taught_holding(standing, taught)
    else:
        stage("choosing grasps")
        placed = cell.with_places(cell.problem, standing)
        sums = objective_of(cell).sums
        kernels = cell.system.by_model(lambda arm: ArmKernels.of(arm, sums))
        holding = choose(placed, kernels, hands, places(stands, by_robot), size)
    file_text = Writer(entries, arms, standing, hands, holding, stands, by_robot)
    text = file_text.write(cell, wishes, default_name(robots), size, shortest, taught is not None)
    made = _read(tomllib.loads(text.text), file)
    return Draft(text.text, tuple(text.guesses), starts(made))


def _read(tables: Mapping[str, Any], file: Path) -> Cell:
    """The cell of a problem file that is not written yet.

    Raises:
        InputError: as for a file, without its name.
    """
    try:
        return Cell.of(parse(tables, source=file))
    except InputError as error:
        raise InputError(error.message, key=error.key) from None


def _space(arms: Sequence[NamedArm]) -> str:
    """The task space that all arms have enough joints for.

    Raises:
        InputError: an arm has too few for any.
    """
    fewest = min(arms, key=lambda arm: len(arm.chain.joints))
    count = len(fewest.chain.joints)
    if count < ChainOptions.fewest:
        named = ", ".join(joint.name for joint in fewest.chain.joints)
        raise InputError(
            f"arm {fewest.name!r} to {fewest.chain.tip!r} has {count} free joints ({named}); "
            f"{ChainOptions.fewest} are needed at least",
            key="--tip",
        )
    # Holding the object's orientation takes six joints.
    return "spatial" if count >= 6 else "spatial-linear"


def _cell(entries: Sequence[RobotEntry], arms: Sequence[NamedArm], space: str, file: Path) -> Cell:
    """The arms, apart from each other so that none clashes, with nothing placed yet."""
    tables: list[dict[str, Any]] = []
    for arm in arms:
        chain = arm.chain
        tables.append(
            {
                "name": arm.name,
                entries[arm.robot].key: entries[arm.robot].place,
                "root": chain.root,
                "tip": chain.tip,
                "locked": arm.locked,
                "base": {"position": [100.0 * arm.robot, 0.0, 0.0]},
                "grasp": {"position": [0.0, 0.0, 0.0]},
            }
        )
    cell = _read(
        {
            "format": 1,
            "name": "draft",
            "task": {"space": space},
            "object": {"mass": 1.0, "inertia": [1.0, 1.0, 1.0], "position": [0.0, 0.0, 0.0]},
            "objective": {"kind": "velocity-volume"},
            "arms": tables,
        },
        file,
    )
    at_origin = tuple(replace(arm, base=Pose.from_rpy()) for arm in cell.arms)
    return cell.with_places(cell.problem, at_origin)


def _box(shortest: float, options: GuessedBox) -> Array:
    """Edges of the guessed box for a shortest reach, m, (3,)."""
    edge = max(round(min(options.edge, options.edge_share * shortest), 2), 0.02)
    return np.full(3, edge)


def _taught(cell: Cell, joints: Mapping[str, Sequence[float]] | None) -> list[Array] | None:
    """Given joint positions of all arms, (n,) each; None where there are none.

    Raises:
        InputError: they are not those of the arms.
    """
    if not joints:
        return None
    names = [arm.name for arm in cell.arms]
    for name in joints:
        if name not in names:
            raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="--joints")
    postures = []
    for arm in cell.arms:
        if arm.name not in joints:
            raise InputError(
                f"are missing for arm {arm.name!r}; give them for every arm, or for none",
                key="--joints",
            )
        q = np.array(joints[arm.name], dtype=float)
        if q.shape != (arm.n,):
            raise InputError(
                f"arm {arm.name!r} has {len(q)} entries; {arm.n} are needed, for "
                + ", ".join(arm.joint_names),
                key="--joints",
            )
        postures.append(q)
    return postures


def _taught_holding(arms: Sequence[Arm], joints: Sequence[Array]) -> GraspedObject:
    """The object midway between the tips, held where they are."""
    tips = [arm.frames(q)[-1] for arm, q in zip(arms, joints, strict=True)]
    middle = reduce(np.add, (tip.position for tip in tips)) / len(tips)
    thing = Pose.from_rpy([number(x, 6) for x in middle])
    return GraspedObject(thing, tuple(thing.inverse() @ tip for tip in tips), tuple(joints))
