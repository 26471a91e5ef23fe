"""Problems that tests are built from."""

from __future__ import annotations

import copy
import tomllib

from reference import PROBLEMS

PANDA = "example-robot-data://panda_description/urdf/panda.urdf"
FILES = sorted(PROBLEMS.glob("*.toml"))


def tables(name: str) -> dict:
    """The tables of one of the shipped problems."""
    return tomllib.loads((PROBLEMS / f"{name}.toml").read_text())


def toml(value: object, prefix: str = "") -> str:
    """Tables as TOML text."""
    if isinstance(value, dict) and not prefix:
        plain = {k: v for k, v in value.items() if not isinstance(v, dict) and k != "arms"}
        lines = [f"{key(k)} = {toml(v, 'x')}" for k, v in plain.items()]
        for k, v in value.items():
            if isinstance(v, dict):
                lines.append(f"[{key(k)}]")
                lines += [f"{key(a)} = {toml(b, 'x')}" for a, b in v.items()]
        arms = value.get("arms", [])
        if isinstance(arms, list) and all(isinstance(arm, dict) for arm in arms) and arms:
            for arm in arms:
                lines.append("[[arms]]")
                lines += [f"{key(a)} = {toml(b, 'x')}" for a, b in arm.items()]
        elif "arms" in value:
            lines.insert(0, f"arms = {toml(arms, 'x')}")
        return "\n".join(lines) + "\n"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key(k)} = {toml(v, 'x')}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(v, "x") for v in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(escape(c) for c in value) + '"'
    return repr(value)


def escape(c: str) -> str:
    if c in '"\\':
        return "\\" + c
    return c if ord(c) >= 32 and ord(c) != 127 else f"\\u{ord(c):04x}"


def key(name: str) -> str:
    return toml(name, "x")


def planar(
    n_arms: int = 2, n_links: int = 3, space: str = "planar-linear", **extra: object
) -> dict:
    """A small planar cell that closes easily."""
    import math

    link = {"length": 0.4, "mass": 1.0, "inertia": 0.03, "com": 0.2}
    arms = []
    for i in range(n_arms):
        turn = math.pi + 2 * math.pi * i / n_arms
        arms.append(
            {
                "name": f"a{i + 1}",
                "links": [dict(link) for _ in range(n_links)],
                "base": {"position": [0.7 * math.cos(turn), 0.7 * math.sin(turn)]},
                "grasp": {"position": [0.15 * math.cos(turn), 0.15 * math.sin(turn)],
                          "angle": turn + math.pi},
            }
        )  # fmt: skip
    thing = {"mass": 0.5, "inertia": 0.01, "position": [0.0, 0.1]}
    cell = {"format": 1, "name": "cell", "task": {"space": space}, "object": thing, "arms": arms}
    return cell | copy.deepcopy(extra)


def two_pandas(space: str = "spatial") -> dict:
    """The shipped two-Panda problem in another space."""
    cell = tables("two-panda-box")
    cell["task"]["space"] = space
    return cell
