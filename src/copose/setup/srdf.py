"""Tips that an SRDF next to a URDF names."""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ET
from pathlib import Path

from copose.errors import InputError
from copose.problem import read_text


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
