"""A compiled MuJoCo model with the names of its links and joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any


def named(enumeration: Any, value: int) -> str:
    """The name of a value of one of MuJoCo's enumerations, such as HINGE."""
    return str(enumeration(int(value)).name).rpartition("_")[2]


@dataclass(frozen=True, eq=False)
class MjcfModel:
    """A compiled model."""

    file: Path  # where it was read
    mujoco: Any
    model: Any

    @cached_property
    def sites(self) -> list[str]:
        """Names of the sites, empty for those that have none."""
        return self.names("SITE", self.model.nsite)

    @cached_property
    def links(self) -> list[str]:
        """Names of the links that bodies are; a site keeps its name before a body of that name."""
        names = self.names("BODY", self.model.nbody)
        taken = {name for name in (*names, *self.sites) if name}
        links: list[str] = []
        for body, name in enumerate(names):
            own = f"{name} (body)" if name in self.sites else name
            links.append(own if own and own not in links else unused(f"body{body}", taken))
            taken.add(links[-1])
        return links

    @cached_property
    def taken(self) -> set[str]:
        """Names of all links."""
        return {*self.links, *self.sites}

    @cached_property
    def joints(self) -> list[str]:
        """Names of all joints."""
        names = self.names("JOINT", self.model.njnt)
        taken = set(names)
        return [name or unused(f"joint{j + 1}", taken) for j, name in enumerate(names)]

    def names(self, kind: str, count: int) -> list[str]:
        """Names of the model's things of a kind, such as BODY; empty for those that have none."""
        of = getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}")
        return [self.mujoco.mj_id2name(self.model, of, i) or "" for i in range(count)]

    def kind(self, j: int) -> str:
        """The kind of joint j as in a tree: one of `MOVABLE`, else in words."""
        kind = named(self.mujoco.mjtJoint, self.model.jnt_type[j])
        hinge = "revolute" if self.model.jnt_limited[j] else "continuous"
        kinds = {"HINGE": hinge, "SLIDE": "prismatic"}
        return kinds.get(kind, f"a {kind.lower()} joint")

    def equalities(self, *kinds: str) -> list[int]:
        """Numbers of the active equality constraints of some kinds, such as WELD."""
        m, of = self.model, self.mujoco.mjtEq
        return [e for e in range(m.neq) if m.eq_active0[e] and named(of, m.eq_type[e]) in kinds]


def unused(name: str, taken: set[str]) -> str:
    """A name that is not taken, with as many primes as that needs."""
    while name in taken:
        name += "'"
    return name
