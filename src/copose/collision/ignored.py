"""Pairs of links that are not tested: by the problem, by an SRDF, or by a MuJoCo model."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any, TypeAlias

from copose.collision.mjcf_geometry import kept_apart
from copose.errors import InputError, arm_key, shown
from copose.problem import RobotArm, read_text
from copose.robots.tree import Tree

_MOST_BYTES = 5_000_000

Links: TypeAlias = tuple[str, str]


def ignored_links(tree: Tree, arms: Mapping[int, Any]) -> tuple[set[Links], list[str]]:
    """Names of two links each, and notes that count them.

    Args:
        tree: the robot.
        arms: its arms as in the problem, by number.

    Raises:
        InputError: a problem names a link that the robot does not have.
    """
    found: set[Links] = set()
    notes: list[str] = []
    for i, arm in arms.items():
        if not isinstance(arm, RobotArm):
            continue
        for pair in arm.ignore_collisions:
            unknown = next((link for link in pair if link not in tree.links), None)
            if unknown is not None:
                raise InputError(
                    f"{tree.file.name} has no link {shown(unknown)}",
                    key=f"{arm_key(i, arm.name)}.ignore_collisions",
                )
        if arm.ignore_collisions:
            found |= set(arm.ignore_collisions)
            notes.append(
                f"{_counted(len(arm.ignore_collisions))} by ignore_collisions of arm {arm.name!r}"
            )
    if tree.model:
        whys = "<exclude>", "contype and conaffinity"
        for pairs, why in zip(kept_apart(tree), whys, strict=True):
            if pairs:
                found |= pairs
                notes.append(f"{_counted(len(pairs))} by {why} of {tree.file.name}")
    file = tree.file.with_suffix(".srdf")
    if file.is_file():
        try:
            root = ET.fromstring(read_text(file, _MOST_BYTES))
        except (InputError, ET.ParseError) as error:
            notes.append(f"{file.name} cannot be read, and disables no pair of links: {error}")
        else:
            disabled = [(each.get("link1", ""), each.get("link2", ""))
                        for each in root.iterfind("disable_collisions")]  # fmt: skip
            if disabled:
                found |= set(disabled)
                notes.append(f"{_counted(len(disabled))} by {file.name}")
    return found, notes


def _counted(count: int) -> str:
    return f"collisions of {count} pair{'s' if count > 1 else ''} of links are ignored"
