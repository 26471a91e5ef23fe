"""The files of a robot that decide an answer."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from copose.collision.links.link_shapes import LINK_FORMATS
from copose.robots.files.file_paths import PACKAGE
from copose.robots.files.mjcf_model import mjcf_files
from copose.robots.robot import Robot


@dataclass(frozen=True)
class RobotSources:
    """The files of a robot that decide an answer.

    Attributes:
        file: the one that names the others. In place of a .xacro, whose own files and folders need
            not be anywhere else, its expansion, as a file beside it that there is not.
        contents: by absolute path, the file's first; None where there is none that could matter.
        packages: folders of the packages that it names.
    """

    file: Path
    contents: Mapping[Path, bytes | None]
    packages: Mapping[str, Path]

    @classmethod
    def of(cls, robot: Robot, *, shapes: bool) -> RobotSources:
        """The files of a robot that was read, with those of its links' shapes where they matter."""
        tree, file = robot.tree, robot.tree.file
        if tree.format == "mjcf":
            contents = {path: content_of(path) for path in mjcf_files(file)}
        elif tree.expansion:
            expansion = b"\xef\xbb\xbf" + tree.expansion.encode()
            mark = hashlib.blake2b(expansion, digest_size=8).hexdigest()
            file = file.with_name(f"{file.stem}-{mark}.urdf")
            contents = {file: expansion}
        else:
            contents = {file: content_of(file)}
        meshes: Mapping[str, Path] = {}
        if shapes:
            contents[file.with_suffix(".srdf")] = content_of(tree.file.with_suffix(".srdf"))
            meshes = LINK_FORMATS[tree.format].geometry(robot, True).files
            contents |= {path: content_of(path) for path in meshes.values()}
        return cls(file, contents, dict(filter(None, map(_package, meshes.items()))))


def content_of(file: Path) -> bytes | None:
    """The bytes of a file; None where there is none that can be read."""
    with contextlib.suppress(OSError):
        return file.read_bytes()
    return None


def _package(mesh: tuple[str, Path]) -> tuple[str, Path] | None:
    """The package of ``package://PACKAGE/…`` and its folder; None of other names."""
    name, path = mesh
    for scheme in (PACKAGE, "model://"):
        if name.startswith(scheme):
            package, _, rest = name.removeprefix(scheme).partition("/")
            folder = path
            for _ in Path(rest).parts:
                folder = folder.parent
            return package, folder
    return None
