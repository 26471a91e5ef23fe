"""The files that a MuJoCo model is made of."""

from __future__ import annotations

import contextlib
import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

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
