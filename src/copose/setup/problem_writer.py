"""The writer of a first problem file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from copose.cell.cell import Cell
from copose.poses import Array, Pose
from copose.problem import SCHEMA
from copose.robots import Arm
from copose.setup.grasps import GraspedObject, Hand
from copose.setup.layout import LayoutOptions, Reach
from copose.setup.robot_entries import NamedArm, RobotEntry


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
