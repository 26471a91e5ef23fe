"""XML as text."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from copose.errors import InputError


def xml_text(root: ET.Element) -> str:
    """An XML document as indented text.

    Raises:
        InputError: a name has a character that XML cannot hold.
    """
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode") + "\n"
    try:
        ET.fromstring(text)
    except ET.ParseError:
        raise InputError("has a name with a character that XML cannot hold") from None
    return text
