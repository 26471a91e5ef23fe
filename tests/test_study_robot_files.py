"""Robot files travel by content, and are part of every point's hash."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cells import toml
from copose.batch.point_solver import points_of
from copose.cell.cell import Cell
from copose.collision import Scene
from copose.studies import Study
from copose.studies.robot_files import PlacedProblems, RobotFiles
from study_robots import arm_study, package, tetrahedron
from test_mjcf import bench
from test_mjcf import cell as bench_cell

REACH = [{"key": "object.position.x", "values": [0.5, 0.6]}]
URDF = "package://parts/urdf/arm.urdf"


def files_of(study: Study) -> RobotFiles:
    return RobotFiles.of(study.problems, study.file)


def digest(folder: Path, vary: list[dict[str, Any]] = REACH, **arm: object) -> str:
    named = {"urdf": URDF, "packages": {"parts": "parts"}} | arm
    return files_of(arm_study(folder, vary, **named)).digests.whole


@pytest.mark.parametrize(
    ("name", "urdf"),
    [
        ("urdf/arm.urdf", URDF),
        ("urdf/arm.srdf", URDF),
        ("meshes/a.stl", URDF),
        ("meshes/b.stl", URDF),
        ("meshes/c.stl", URDF),
        ("urdf/links.xacro", "package://parts/urdf/arm.xacro"),
    ],
)
def test_every_file_counts(name: str, urdf: str, tmp_path: Path) -> None:
    file = package(tmp_path / "parts") / name
    before = digest(tmp_path, urdf=urdf)
    assert digest(tmp_path, urdf=urdf) == before
    one_byte = {".stl": ("solid s", "solid t"), ".srdf": ('link2="l3"', 'link2="l2"')}
    old, new = one_byte.get(file.suffix, ('lower="-2"', 'lower="-1"'))
    file.write_text(file.read_text().replace(old, new, 1))
    assert digest(tmp_path, urdf=urdf) != before


def test_what_does_not_matter_does_not_count(tmp_path: Path) -> None:
    package(tmp_path / "one/parts")
    before = digest(tmp_path / "one")
    text = (tmp_path / "one/parts/urdf/arm.urdf").read_text()
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    assert digest(tmp_path / "two") == before
    # Nor do looks, which are not there at all until now.
    tetrahedron(tmp_path / "two/parts/meshes/fine.stl", 1.0)
    assert digest(tmp_path / "two") == before
    # Two meshes that change places are another robot.
    meshes = tmp_path / "two/parts/meshes"
    (meshes / "a.stl").rename(meshes / "x.stl")
    (meshes / "b.stl").rename(meshes / "a.stl")
    (meshes / "x.stl").rename(meshes / "b.stl")
    assert digest(tmp_path / "two") != before
    assert (tmp_path / "two/parts/urdf/arm.urdf").read_text() == text


def test_robots_that_only_some_points_name_count(tmp_path: Path) -> None:
    package(tmp_path / "parts")
    other = package(tmp_path / "other") / "urdf/arm.urdf"
    vary: list[dict[str, Any]] = [
        *REACH,
        {"key": "arms.a.urdf", "values": [URDF, "other/urdf/arm.urdf"]},
        {"key": "constraints.collision", "values": [False, True]},
    ]
    before = digest(tmp_path, vary)
    assert before != digest(tmp_path)
    other.write_text(other.read_text().replace('lower="-2"', 'lower="-1"', 1))
    assert digest(tmp_path, vary) != before


def shapes(problem: Any) -> tuple[Mapping[str, np.ndarray], Any]:
    """Corners of all solids by name, and the pairs that are tested."""
    cell = Cell.of(problem)
    scene = Scene.of(problem, cell.arms)
    corners = {
        solid.name: np.vstack([part.shape.hull[0] for part in solid.parts])
        for solid in scene.solids
    }
    return corners, scene.pairs


@pytest.mark.parametrize("name", ["arm.urdf", "arm.xacro"])
def test_a_robot_is_the_same_elsewhere(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(tmp_path / "ros/parts")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    study = arm_study(tmp_path, REACH, urdf=f"package://parts/urdf/{name}")
    files = files_of(study)
    expected, pairs = shapes(study.problems.at({}))
    assert {"a/l1", "a/l2", "a/l3"} < set(expected)
    assert files.places.there == (name == "arm.urdf")
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "ros").rename(tmp_path / "gone")
    assert not files.places.there
    root = tmp_path / "worker"
    files.write(root)
    assert not (tmp_path / "ros").exists()
    placed = PlacedProblems(study.problems, files.places, root).at({})
    found, found_pairs = shapes(placed)
    assert found.keys() == expected.keys()
    for solid, corners in expected.items():
        np.testing.assert_array_equal(found[solid], corners)
    assert (found_pairs == pairs) if not hasattr(pairs, "shape") else (found_pairs == pairs).all()


def test_a_mujoco_model_is_the_same_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    bench(tmp_path)
    (tmp_path / "p.toml").write_text(toml(bench_cell()))
    study = {
        "format": 1,
        "name": "s",
        "problem": "p.toml",
        "vary": [{"key": "object.mass", "values": [1.0]}],
    }
    (tmp_path / "study.toml").write_text(toml(study))
    read = Study.read(tmp_path / "study.toml")
    files = files_of(read)
    expected = [arm.fingerprint for arm in Cell.of(read.problems.at({})).arms]
    names = {file.name for file in files.contents}
    assert names == {
        "bench.xml",
        "defaults.xml",
        "arms.xml",
        "drives.xml",
        "hand_left.xml",
        "hand_right.xml",
    }
    (tmp_path / "robot").rename(tmp_path / "gone")
    files.write(tmp_path / "worker")
    placed = PlacedProblems(read.problems, files.places, tmp_path / "worker").at({})
    assert [arm.fingerprint for arm in Cell.of(placed).arms] == expected


def test_another_robot_leaves_the_hashes_of_the_others(tmp_path: Path) -> None:
    """The file of a robot counts at the points that read it, and at no others."""
    files = {name: package(tmp_path / name) / "urdf/arm.urdf" for name in ("one", "two", "three")}
    for i, file in enumerate(files.values()):
        file.write_text(file.read_text().replace('lower="-2"', f'lower="-1.{i}"', 1))

    def hashes(*names: str) -> dict[str, bytes]:
        robots = {"key": "arms.a.urdf", "values": [f"{name}/urdf/arm.urdf" for name in names]}
        study = arm_study(tmp_path, [robots, *REACH], packages={"parts": "one"})
        points = points_of(study, range(len(study.points)))
        return {str(point.values): point.point_hash for point in points}

    before = hashes("one", "two")
    assert before.items() <= hashes("three", "two", "one").items()
    files["two"].write_text(files["two"].read_text().replace('upper="2"', 'upper="1"', 1))
    after = hashes("one", "two")
    same = {values for values in before if after[values] == before[values]}
    assert same == {values for values in before if "one/" in values}
