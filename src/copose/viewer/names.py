"""Names of nodes of a scene: paths, of which a name in a problem file is one step."""

from __future__ import annotations

from urllib.parse import quote


def node(*steps: str) -> str:
    """The path of a node: ``/arms/left/joint1``.

    A slash in a step would be two steps, so it is written ``%2F``, and a percent sign ``%25``.
    """
    return "".join(
        "/" + step.replace("%", "%25").replace("/", quote("/", safe="")) for step in steps
    )
