"""A robot of many files, and studies of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cells import toml
from copose.studies import Study

XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
LINK = """<joint name="j{i}" type="revolute"><parent link="l{j}"/><child link="l{i}"/>
  <origin xyz="0.3 0 0"/><axis xyz="{axis}"/>
  <limit lower="-2" upper="2" effort="10" velocity="1"/></joint>
<link name="l{i}"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><mesh filename="{mesh}" scale="0.1 0.1 0.1"/></geometry></collision>
  <visual><geometry><mesh filename="package://parts/meshes/fine.stl"/></geometry></visual></link>"""
TIP = """<link name="tip"/><joint name="end" type="fixed"><parent link="l3"/><child link="tip"/>
  <origin xyz="0.3 0 0"/></joint>"""
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))


def tetrahedron(file: Path, size: float) -> None:
    """A mesh file."""
    facets = []
    for out in range(4):
        a, b, c = (corner for i, corner in enumerate(CORNERS) if i != out)
        vertices = "".join(
            "vertex " + " ".join(str(size * x) for x in corner) + "\n" for corner in (a, b, c)
        )
        facets.append(f"facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    file.write_text("solid s\n" + "".join(facets) + "endsolid s\n")


def package(folder: Path) -> Path:
    """A package with a robot whose meshes are named relatively, by the package and by a path, and
    the same robot in two files of xacro.
    """
    for name in ("urdf", "meshes"):
        (folder / name).mkdir(parents=True)
    for i, name in enumerate(("a", "b", "c"), start=1):
        tetrahedron(folder / f"meshes/{name}.stl", 0.5 * i)
    (folder / "package.xml").write_text("<package><name>parts</name></package>")
    meshes = ("package://parts/meshes/a.stl", "../meshes/b.stl", f"file://{folder}/meshes/c.stl")
    axes = ("0 0 1", "0 1 0", "0 1 0")
    links = "".join(
        LINK.format(i=i, j=i - 1, mesh=mesh, axis=axis)
        for i, (mesh, axis) in enumerate(zip(meshes, axes, strict=True), start=1)
    )
    body = f'<link name="l0"/>{links}{TIP}'
    (folder / "urdf/arm.urdf").write_text(f'<robot name="arm">{body}</robot>')
    (folder / "urdf/arm.srdf").write_text(
        '<robot name="arm"><disable_collisions link1="l1" link2="l3"/></robot>'
    )
    (folder / "urdf/links.xacro").write_text(f"<robot {XMLNS}>{body}</robot>")
    include = '<xacro:include filename="$(find parts)/urdf/links.xacro"/>'
    (folder / "urdf/arm.xacro").write_text(f'<robot name="arm" {XMLNS}>{include}</robot>')
    return folder


def arm_study(folder: Path, vary: list[dict[str, Any]], **arm: object) -> Study:
    """A study of one arm that holds something with a ball joint, and touches nothing."""
    cell = {
        "format": 1,
        "name": "x",
        "task": {"space": "spatial-linear"},
        "object": {
            "mass": 1.0,
            "position": [0.6, 0.1, 0.4],
            "shape": {"kind": "sphere", "radius": 0.02},
        },
        "constraints": {"collision": True, "clearance": 0.001},
        "arms": [{"name": "a", "tip": "tip", "grasp": {"position": [0, 0, 0]}, **arm}],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "problem.toml").write_text(toml(cell))
    study = {"format": 1, "name": "arms", "effort": "low", "problem": "problem.toml", "vary": vary}
    (folder / "study.toml").write_text(toml(study))
    return Study.read(folder / "study.toml")
