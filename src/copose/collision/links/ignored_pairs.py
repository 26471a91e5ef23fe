"""Pairs of links that are not tested: by the problem, by an SRDF, or by the robot's own file."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

from copose.collision.links.link_formats import LINK_FORMATS
from copose.collision.links.link_geometry import LinkPair
from copose.errors import InputError, arm_key, shown
from copose.problem import RobotArm, read_text
from copose.robots.files.tree import Tree


def ignored_links(
    tree: Tree, arms: Mapping[int, Any], most_bytes: int = 5_000_000
) -> tuple[set[LinkPair], list[str]]:
    """Pairs of links that are not tested, and notes that count them.

    Args:
        tree: the robot.
        arms: its arms as in the problem, by number.
        most_bytes: of an SRDF.

    Raises:
        InputError: a problem names a link that the robot does not have.
    """
    ignored: set[LinkPair] = set()
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
            ignored |= set(arm.ignore_collisions)
            notes.append(
                f"{_counted(len(arm.ignore_collisions))} by ignore_collisions of arm {arm.name!r}"
            )
    for reason, pairs in LINK_FORMATS[tree.format].kept_apart(tree).items():
        if pairs:
            ignored |= pairs
            notes.append(f"{_counted(len(pairs))} by {reason} of {tree.file.name}")
    file = tree.file.with_suffix(".srdf")
    if file.is_file():
        try:
            root = ET.fromstring(read_text(file, most_bytes))
        except (InputError, ET.ParseError) as error:
            notes.append(f"{file.name} cannot be read, and disables no pair of links: {error}")
        else:
            disabled = [
                (element.get("link1", ""), element.get("link2", ""))
                for element in root.iterfind("disable_collisions")
            ]
            if disabled:
                ignored |= set(disabled)
                notes.append(f"{_counted(len(disabled))} by {file.name}")
    return ignored, notes


def _counted(count: int) -> str:
    return f"collisions of {count} pair{'s' if count > 1 else ''} of links are ignored"
