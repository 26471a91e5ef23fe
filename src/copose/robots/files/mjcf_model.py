"""A compiled MuJoCo model, and the files that it is made of."""

from __future__ import annotations

import contextlib
import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterator
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


# Attributes of <compiler> with folders of files, and elements that name other models.
_FOLDERS = ("assetdir", "meshdir", "texturedir")
_MODELS = ("include", "model")


def mjcf_files(model: Path) -> list[Path]:
    """A model's own file, models that it includes, and all other files that they name.

    Whether a name starts from the model's folder, the including file's or ``meshdir``, and with its
    own folders or without, depends on the version of MuJoCo: what is there counts.
    """
    models, roots = [model], list[ET.Element]()
    for file in models:
        with contextlib.suppress(OSError, ET.ParseError):
            roots.append(ET.fromstring(file.read_bytes()))
            places = dict.fromkeys((model.parent, file.parent))
            for name in _names(roots[-1], _MODELS):
                models += [path for path in _there(places, name) if path not in models]
    elements = [element for root in roots for element in root.iter("compiler")]
    folders = {element.get(key, "") for element in elements for key in _FOLDERS}
    bases = dict.fromkeys(file.parent for file in models)
    places = {base / folder: None for base in bases for folder in sorted({"", *folders})}
    names = itertools.chain.from_iterable(_names(root) for root in roots)
    named = [path for name in names for path in _there(places, name)]
    return list(dict.fromkeys([*models, *named]))


def _names(root: ET.Element, tags: tuple[str, ...] = ()) -> Iterator[str]:
    """Names of files in the elements of some kinds, or in all."""
    for element in root.iter():
        if not tags or element.tag in tags:
            yield from (name for key, name in element.items() if key.startswith("file"))


def _there(places: dict[Path, None], name: str) -> Iterator[Path]:
    """The files that a name may mean."""
    for place in places:
        for path in dict.fromkeys((place / name, place / Path(name).name)):
            with contextlib.suppress(OSError, ValueError):
                if path.is_file():
                    yield path
