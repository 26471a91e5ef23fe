"""Robots that a command line names, and their arms."""

from __future__ import annotations

import contextlib
import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from copose.errors import InputError, nearest
from copose.problem import read_text
from copose.robots.files.file_paths import resolve
from copose.robots.files.mjcf_tree import first_tag, read_mjcf
from copose.robots.files.urdf_tree import read_tree
from copose.robots.robot import Robot
from copose.setup.chains import ArmChain, chain_to, find_chains


def srdf_tips(urdf: Path, robot: str, most_bytes: int = 5_000_000) -> frozenset[str]:
    """Links on which chains and end effectors of a robot's SRDFs hang.

    SRDFs are looked for next to the URDF, and in a folder ``srdf`` next to its own. Files that
    cannot be read count as empty.
    """
    tips: set[str] = set()
    for file in sorted([*urdf.parent.glob("*.srdf"), *urdf.parent.parent.glob("srdf/*.srdf")]):
        with contextlib.suppress(InputError, ET.ParseError):
            root = ET.fromstring(read_text(file, most_bytes))
            if root.get("name") != robot:
                continue
            for chain in root.iterfind("group/chain"):
                tips.add(chain.get("tip_link", ""))
            for hand in root.iterfind("end_effector"):
                tips.add(hand.get("parent_link", ""))
    return frozenset(tips)


@dataclass(frozen=True, eq=False)
class NamedArm:
    """An arm of one of the robots."""

    name: str  # in the problem
    robot: int  # which of the robots it is part of
    chain: ArmChain

    @property
    def locked(self) -> dict[str, float]:
        """Positions of the locked joints, rad or m, by name."""
        return {joint.name: position for joint, position, _ in self.chain.locked}


@dataclass(frozen=True, eq=False)
class RobotEntry:
    """A robot that a command line names."""

    key: str  # that names it in the problem file, ``urdf`` or ``mjcf``
    place: str  # as the problem file names it
    stem: str  # its file's name
    robot: Robot  # the robot that it describes
    named: frozenset[str]  # links that an SRDF next to it calls tips

    @classmethod
    def of(cls, entry: str, folder: Path) -> RobotEntry:
        """Read a robot.

        Args:
            entry: a path, ``package://…`` or ``example-robot-data://…``, of a MuJoCo model to an
                .xml.
            folder: that the problem file will be in.

        Raises:
            InputError: it cannot be read.
        """
        file = resolve(entry, Path(), {})
        try:
            file = file.resolve()
            mjcf = file.suffix == ".xml" and first_tag(file) == "mujoco"
            tree = read_mjcf(file) if mjcf else read_tree(file, {}, {})
        except InputError as error:
            raise InputError(error.message, file=error.file or entry) from None
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(f"is no usable path: {error}", file=entry) from None
        place = entry if "://" in entry else _relative(file, folder)
        key = "mjcf" if mjcf else "urdf"
        return cls(key, place, file.stem, Robot(tree, {}), srdf_tips(file, tree.name))


def _relative(file: Path, folder: Path) -> str:
    """The path of a file from a folder, as a problem file has it."""
    try:
        return Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:
        # Another drive.
        return str(file)


def named_arms(robots: Sequence[RobotEntry], tips: Sequence[str]) -> list[NamedArm]:
    """The arms of all robots and what they are called; a robot that has none of the tips, ``link``
    or ``name=link``, is searched for arms.

    Raises:
        InputError: a robot without arms, or a tip that no robot has.
    """
    asked: list[list[tuple[str, str]]] = [[] for _ in robots]
    for entry in tips:
        name, _, link = entry.rpartition("=")
        having = [k for k, owner in enumerate(robots) if link in owner.robot.tree.links]
        if not having:
            every = [known for owner in robots for known in owner.robot.tree.links]
            raise InputError(
                f"{link!r} is no link of the robots{nearest(link, every)}", key="--tip"
            )
        if name:
            default = (
                ("left", "right").index(name)
                if name in ("left", "right") and len(robots) == 2
                else -1
            )
            fewest = min(having, key=lambda k: len(asked[k]))
            asked[default if default in having else fewest].append((name, link))
        else:
            for k in having:
                asked[k].append(("", link))
    arms: list[NamedArm] = []
    for k, robot in enumerate(robots):
        tree = robot.robot.tree
        if asked[k]:
            links = [link for _, link in asked[k]]
            chains = [chain_to(tree, link, links) for link in links]
        else:
            chains = find_chains(tree, robot.named)
        if not chains:
            raise InputError(
                "has no arm that is found; name the link that grasps by --tip LINK",
                file=robot.place,
            )
        names = [name for name, _ in asked[k]] or [""] * len(chains)
        arms += [NamedArm(name, k, chain) for name, chain in zip(names, chains, strict=True)]
    return _renamed(arms, len(robots))


def _renamed(arms: Sequence[NamedArm], robots: int) -> list[NamedArm]:
    """Arms with names of their own: those asked for, sides, else the tips' or a number."""
    alone = robots == len(arms)
    renamed: list[NamedArm] = []
    for i, arm in enumerate(arms):
        name = arm.name
        if not name and alone and robots > 1:
            name = ("left", "right")[i] if robots == 2 else f"arm{i + 1}"
        if not name:
            mates = [other for other in arms if other.robot == arm.robot]
            sided = sum(other.chain.side == arm.chain.side for other in mates) == 1
            name = arm.chain.side if arm.chain.side and sided else arm.chain.tip
            name += str(arm.robot + 1) if robots > 1 else ""
        renamed.append(replace(arm, name=name))
    names = [arm.name for arm in renamed]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"two arms are called {name!r}; give each a name of its own, --tip NAME=LINK",
                key="--tip",
            )
    return renamed
