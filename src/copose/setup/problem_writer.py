"""A first problem file for robots: arms, bases, the object's place, and grasps are guessed."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from copose.problem import SCHEMA
from copose.progress import stage
from copose.robots import Arm, ArmStart
from copose.self_motion.kernels import ArmKernels
from copose.setup.chains import ChainOptions
from copose.setup.grasps import GraspedObject, Hand, LayoutOptions, Reach, bases, choose, places
from copose.setup.robot_entries import NamedArm, RobotEntry, named_arms


def number(value: float, digits: int = 12) -> float:
    """A number without the last digits, and without a sign on zero."""
    return round(float(value), digits) + 0.0


def plain_line(text: str) -> str:
    """Text without line ends and other unprintable letters, which names of robots may hold."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def placement(pose: Pose) -> dict[str, list[float]]:
    """A pose as a problem file has it; ``rpy`` left out where it is zero."""
    rpy = [number(angle, 15) for angle in pose.plain_rpy]
    rpy = [0.0 if abs(angle) < 1e-12 else angle for angle in rpy]
    place = {"position": [number(x) for x in pose.position]}
    return place | ({"rpy": rpy} if any(rpy) else {})


def toml(value: object) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, Mapping):
        pairs = (f"{_key(key)} = {toml(item)}" for key, item in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, str):
        # TOML's strings are JSON's, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(toml, value)) + "]"
    assert isinstance(value, int | float)
    return repr(value)


def _key(key: str) -> str:
    """A key as TOML, in quotation marks where it needs them."""
    plain = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if plain else toml(key)


@dataclass
class ProblemText:
    """A problem file that grows line by line."""

    lines: list[str] = field(default_factory=list)  # so far
    guesses: list[str] = field(default_factory=list)  # what was guessed, in words, in order
    _arm: str = ""

    def remark(self, *lines: str) -> None:
        """Add comment lines."""
        self.lines += [f"# {plain_line(line)}" for line in lines]

    def table(self, header: str, arm: str = "") -> None:
        """Begin a table; of an arm with its name."""
        self.lines += ["", header]
        self._arm = f"{arm}: " if arm else ""

    def put(self, key: str, value: object, guess: str = "", change: str = "") -> None:
        """Add a key, with a comment on how it was guessed, if it was, and what to change."""
        if guess:
            short = len(toml(value)) <= 60
            named = f"{key} = {toml(value)}" if short else key
            self.guesses.append(f"{self._arm}{named}: {guess}")
            self.remark("guessed: " + "; ".join(filter(None, (guess, change))))
        self.lines.append(f"{key} = {toml(value)}")

    @property
    def text(self) -> str:
        """The file's content."""
        return "\n".join(self.lines) + "\n"


@dataclass(frozen=True)
class GuessedBox:
    """The box that is guessed as object."""

    edge: float = 0.3  # m, at most
    edge_share: float = 0.3  # of the shortest reach, at most
    mass: float = 1.0  # for arms with a long reach, kg
    light_mass: float = 0.1  # for others, kg
    long_reach: float = 0.5  # m


@dataclass(frozen=True, eq=False)
class Wishes:
    """Parts of a problem that a command line gives and that are not guessed."""

    tips: Sequence[str] = ()  # ``link`` or ``name=link``
    joints: Mapping[str, Sequence[float]] | None = None  # by arm
    mass: float | None = None  # of the object, kg
    size: Sequence[float] | None = None  # of the box that it is, m
    space: str | None = None  # of the task


@dataclass(frozen=True, eq=False)
class Writer:
    """The writer of a problem file, with all that its lines tell."""

    entries: Sequence[RobotEntry]
    arms: Sequence[NamedArm]
    chains: Sequence[Arm]
    hands: Sequence[Hand]
    holding: GraspedObject
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
            self._arm(text, i, taught)
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
        mass, guess, box = wishes.mass, "", GuessedBox()
        if mass is None:
            mass = box.mass if shortest > box.long_reach else box.light_mass
            guess = "a light load, kg"
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

    def _arm(self, text: ProblemText, i: int, taught: bool) -> None:
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
            text.put("locked", arm.locked, f"held still ({why})", "rad or m")
        if len(self.entries) > 1:
            apart = LayoutOptions.apart
            text.put(
                "base", placement(self.stands[arm.robot]),
                f"robots face each other, each {apart:g} of its reach from the middle",
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
