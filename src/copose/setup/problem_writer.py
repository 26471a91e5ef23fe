"""The writer of a first problem file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from copose.cell.cell import Cell
from copose.poses import Array, Pose
from copose.problem import SCHEMA
from copose.robots import Arm
from copose.setup.grasps import GraspedObject
from copose.setup.hands import Hand
from copose.setup.layout import LayoutOptions, Reach
from copose.setup.problem_text import ProblemText, number, placement, plain_line
from copose.setup.robot_entries import NamedArm, RobotEntry


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
