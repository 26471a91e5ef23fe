"""The tips that an SRDF beside a URDF names."""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ET
from pathlib import Path

from copose.errors import InputError
from copose.problem import read_text

_MOST_BYTES = 5_000_000


def srdf_tips(urdf: Path, robot: str) -> frozenset[str]:
    """Links that chains and end effectors of SRDFs hang on, of files beside a URDF, or in a folder
    ``srdf`` beside its own, that are for the robot. What cannot be read says nothing.

    Args:
        urdf: its file.
        robot: the robot's name in it.
    """
    found: set[str] = set()
    for file in sorted([*urdf.parent.glob("*.srdf"), *urdf.parent.parent.glob("srdf/*.srdf")]):
        with contextlib.suppress(InputError, ET.ParseError):
            root = ET.fromstring(read_text(file, _MOST_BYTES))
            if root.get("name") != robot:
                continue
            for chain in root.iterfind("group/chain"):
                found.add(chain.get("tip_link", ""))
            for hand in root.iterfind("end_effector"):
                found.add(hand.get("parent_link", ""))
    return frozenset(found)
