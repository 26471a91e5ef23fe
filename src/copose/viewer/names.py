"""Names of nodes of a scene, and colours, as viser takes them."""

from __future__ import annotations

from urllib.parse import quote


def node(*steps: str) -> str:
    """The path of a node: ``/arms/left/joint1``.

    A slash in a step would be two steps, so it is written ``%2F``, and a percent sign ``%25``.
    """
    return "".join(
        "/" + step.replace("%", "%25").replace("/", quote("/", safe="")) for step in steps
    )


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour such as ``#D55E00``, 0 to 255."""
    red, green, blue = bytes.fromhex(color.removeprefix("#"))
    return red, green, blue
