"""From robots to a first problem file."""

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
from copose.objectives.build import objective_of
from copose.poses import Array, Pose
from copose.posture.start_postures import starts
from copose.problem import SCHEMA
from copose.progress import stage
from copose.robots import Arm, ArmStart
from copose.self_motion.kernels import ArmKernels
from copose.setup.chains import FEWEST
from copose.setup.grasps import Holding, choose
from copose.setup.hands import Hand
from copose.setup.layout import APART, Reach, bases, places
from copose.setup.problem_text import ProblemText, number, placement, plain_line
from copose.setup.robot_entries import NamedArm, RobotEntry, named_arms

# Joints that holding the object's orientation takes.
_RIGID = 6
# The longest edge of a box, m, and as a part of the shortest reach; masses, kg, of boxes for arms
# that are longer than so many m, and for others.
_EDGE, _EDGE_SHARE = 0.3, 0.3
_MASS, _LIGHT, _LONG = 1.0, 0.1, 0.5


@dataclass(frozen=True, eq=False)
class Wishes:
    """What a command line says that is then not guessed.

    Attributes:
        tips: ``link`` or ``name=link``.
        joints: by arm.
        mass: of the object, kg.
        size: of the box that it is, m.
        space: of the task.
    """

    tips: Sequence[str] = ()
    joints: Mapping[str, Sequence[float]] | None = None
    mass: float | None = None
    size: Sequence[float] | None = None
    space: str | None = None


@dataclass(frozen=True, eq=False)
class Draft:
    """A first problem file.

    Attributes:
        text: its content.
        guesses: what was guessed, in words.
        starts: the arms where the file has them, or as near as they come.
    """

    text: str
    guesses: tuple[str, ...]
    starts: tuple[ArmStart, ...]


def default_name(robots: Sequence[str]) -> str:
    """What a problem of some robots is called: ``baxter``, ``two-panda``, ``panda-ur5``."""
    stems = [Path(robot).stem for robot in robots]
    if len(stems) > 1 and len({*stems}) == 1:
        return f"{_COUNTS.get(len(stems), len(stems))}-{stems[0]}"
    return "-".join(stems)[:_LONGEST_NAME]


_LONGEST_NAME = 60
_COUNTS = {2: "two", 3: "three", 4: "four"}


@one_at_a_time
def draft(robots: Sequence[str], file: Path, wishes: Wishes) -> Draft:
    """A problem of robots around one object, every guess of it with a comment.

    Args:
        robots: URDFs and MuJoCo models, as `RobotEntry.of` takes them.
        file: that it will be written to.
        wishes: what is not guessed.

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
        Hand.of(entries[arm.robot].robot, shapes[arm.robot], chain, _locked(arm))
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
    size = np.array(wishes.size) if wishes.size is not None else _box(shortest)
    if taught is not None:
        holding = _taught_holding(standing, taught)
    else:
        stage("choosing grasps")
        placed = cell.with_places(cell.problem, standing)
        holding = choose(placed, _kernels(cell), hands, places(stands, by_robot), size)
    file_text = _Writer(entries, arms, standing, hands, holding, stands, by_robot)
    text = file_text.write(cell, wishes, default_name(robots), size, shortest, taught is not None)
    made = _read(tomllib.loads(text.text), file)
    return Draft(text.text, tuple(text.guesses), starts(made))


def _read(tables: Mapping[str, Any], file: Path) -> Cell:
    """A problem file that is not there yet.

    Raises:
        InputError: as for a file, which it does not name.
    """
    try:
        return Cell.of(parse(tables, source=file))
    except InputError as error:
        raise InputError(error.message, key=error.key) from None


def _space(arms: Sequence[NamedArm]) -> str:
    fewest = min(arms, key=lambda arm: len(arm.chain.joints))
    count = len(fewest.chain.joints)
    if count < FEWEST:
        named = ", ".join(joint.name for joint in fewest.chain.joints)
        raise InputError(
            f"arm {fewest.name!r} to {fewest.chain.tip!r} has {count} free joints ({named}); "
            f"{FEWEST} are needed at least",
            key="--tip",
        )
    return "spatial" if count >= _RIGID else "spatial-linear"


def _locked(arm: NamedArm) -> dict[str, float]:
    return {joint.name: position for joint, position, _ in arm.chain.locked}


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
                "locked": _locked(arm),
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


def _kernels(cell: Cell) -> list[ArmKernels]:
    sums = objective_of(cell).sums
    known: dict[bytes, ArmKernels] = {}
    for arm, mechanics in zip(cell.arms, cell.system.arms, strict=True):
        if arm.fingerprint not in known:
            known[arm.fingerprint] = ArmKernels.of(mechanics, sums)
    return [known[arm.fingerprint] for arm in cell.arms]


def _box(shortest: float) -> Array:
    edge = max(round(min(_EDGE, _EDGE_SHARE * shortest), 2), 0.02)
    return np.full(3, edge)


def _taught(cell: Cell, joints: Mapping[str, Sequence[float]] | None) -> list[Array] | None:
    """Joint angles of all arms, (n,) each, where they are given.

    Raises:
        InputError: they are not those of the arms.
    """
    if not joints:
        return None
    names = [arm.name for arm in cell.arms]
    for name in joints:
        if name not in names:
            raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="--joints")
    found = []
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
        found.append(q)
    return found


def _taught_holding(arms: Sequence[Arm], joints: Sequence[Array]) -> Holding:
    """The object midway between the tips, held where they are."""
    tips = [arm.frames(q)[-1] for arm, q in zip(arms, joints, strict=True)]
    middle = reduce(np.add, (tip.position for tip in tips)) / len(tips)
    thing = Pose.from_rpy([number(x, 6) for x in middle])
    return Holding(thing, tuple(thing.inverse() @ tip for tip in tips), tuple(joints))


@dataclass(frozen=True, eq=False)
class _Writer:
    """What the lines of a problem file are made of."""

    entries: Sequence[RobotEntry]
    arms: Sequence[NamedArm]
    chains: Sequence[Arm]
    hands: Sequence[Hand]
    holding: Holding
    stands: Sequence[Pose]
    reaches: Sequence[Sequence[Reach]]

    def write(
        self, cell: Cell, wishes: Wishes, name: str, size: Array, shortest: float, taught: bool
    ) -> ProblemText:
        """The file, line by line."""
        text = ProblemText()
        text.lines.append(f"#:schema {plain_line(str(SCHEMA))}")
        text.remark(
            'Made by copose init. What stands under a line that begins with "guessed" is yours to',
            "change; copose check FILE --figure FILE.png shows where everything is.",
        )
        text.put("format", 1)
        text.put("name", name)
        text.table("[task]")
        self._task(text, cell, wishes.space)
        text.table("[object]")
        self._object(text, wishes, size, shortest, taught)
        for i in range(len(self.arms)):
            self._arm(text, i, size, taught)
        text.table("[objective]")
        kind = "velocity-volume" if cell.weightless else "volume"
        guess = "the robots' inertials are missing" if cell.weightless else ""
        text.put("kind", kind, guess, 'with inertials: "volume"' if guess else "")
        return text

    def _task(self, text: ProblemText, cell: Cell, asked: str | None) -> None:
        space = cell.problem.task.space
        guess = (
            "an arm has fewer than 6 joints, so the grasps are ball joints"
            if space == "spatial-linear"
            else "rigid grasps"
        )
        other = (
            '"spatial" for rigid grasps'
            if space == "spatial-linear"
            else '"spatial-linear" for ball joints'
        )
        text.put("space", space, "" if asked else guess, other)

    def _object(
        self, text: ProblemText, wishes: Wishes, size: Array, shortest: float, taught: bool
    ) -> None:
        mass = wishes.mass
        guess = ""
        if mass is None:
            mass, guess = (_MASS if shortest > _LONG else _LIGHT), "a light load, kg"
        text.put("mass", mass, guess, "what your object weighs")
        inertia = [number(mass * (size @ size - edge**2) / 12, 9) for edge in size]
        text.put("inertia", inertia, "of a solid box, kg·m², about the centre of mass")
        where = "midway between the tips" if taught else "where the arms close most easily"
        text.put(
            "position", [number(x) for x in self.holding.object.position], where,
            "m, of the centre of mass in the world",
        )  # fmt: skip
        guess = "" if wishes.size is not None else "a box, m"
        shape = {"kind": "box", "size": [number(edge) for edge in size]}
        text.put("shape", shape, guess, "its edges; it is drawn, and tested for collision")

    def _arm(self, text: ProblemText, i: int, size: Array, taught: bool) -> None:
        arm, hand = self.arms[i], self.hands[i]
        chain, q = self.chains[i], self.holding.starts[i]
        text.table("[[arms]]", arm.name)
        text.put("name", arm.name)
        text.put(self.entries[arm.robot].key, self.entries[arm.robot].place)
        if arm.chain.root != arm.chain.tree.root:
            text.put("root", arm.chain.root, "what is above it cannot be held still")
        asked = arm.chain.why == "as asked"
        text.put(
            "tip", arm.chain.tip, "" if asked else arm.chain.why,
            "the link that grasps",
        )  # fmt: skip
        if arm.chain.locked:
            why = ", ".join(f"{joint.name}: {text}" for joint, _, text in arm.chain.locked)
            text.put("locked", _locked(arm), f"held still ({why})", "rad or m")
        if len(self.entries) > 1:
            text.put(
                "base", placement(self.stands[arm.robot]),
                f"robots face each other, each {APART:g} of its reach from the middle",
                "where its root link stands in the world",
            )  # fmt: skip
        if taught:
            text.remark("no grasp: it is where the joints below have the tip")
        else:
            how = f"the tip's {hand.name} axis towards the object"
            how += ", for nothing says which" if hand.guess else ""
            how += f", {hand.reach:g} m from its face" if hand.reach else ", on its face"
            text.put("grasp", placement(self.holding.grasps[i]), how, "tip frame in the object's")
        if q is not None:
            text.remark(f"joints, rad or m: {', '.join(chain.joint_names)}")
            guess = "" if taught else "a posture that holds the object"
            text.put("start", [number(x, 10) for x in q], guess)
