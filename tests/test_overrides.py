"""`--set`, `--objective` and `--direction` stand in the place of a file's keys."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import copose
from cells import planar, toml, two_pandas
from copose.commands.command_line import main
from copose.errors import InputError
from copose.problem import overridden, read_override
from copose.problem import parse as parse_complete

SHAPE = {"kind": "sphere", "radius": 0.1}


def cell() -> dict:
    tables = two_pandas()
    tables["arms"][0]["name"] = "le.ft"
    tables["obstacles"] = [{"name": "table", "shape": dict(SHAPE), "position": [3, 0, 0]}]
    tables["cases"] = [{"name": "one", "rpy": [0, 0, 0.1]}, {"name": "two"}]
    return tables


def at(tables: dict, *path: object) -> object:
    node: object = tables
    for part in path:
        node = node[part]  # type: ignore[index]
    return node


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("object.mass=3", ("object", "mass"), 3),
        ("name = else", ("name",), " else"),
        ("name='else'", ("name",), "else"),
        ("arms.right.tip=tool=0", ("arms", 1, "tip"), "tool=0"),
        ('arms."le.ft".base.position.y=0.4', ("arms", 0, "base"), {"position": [0.0, 0.4, 0.0]}),
        ("arms.'le.ft'.grasp.position.2=0.4", ("arms", 0, "grasp", "position", 2), 0.4),
        ("arms.right.locked.j=0.1", ("arms", 1, "locked"), {"j": 0.1}),
        ("obstacles.table.position.x=4", ("obstacles", 0, "position", 0), 4),
        ("cases.two.mass=2", ("cases", 1), {"name": "two", "mass": 2}),
        ("object.rpy=[1,2,3]", ("object", "rpy"), [1, 2, 3]),
        ("object.shape={kind='sphere', radius=0.1}", ("object", "shape"), SHAPE),
        ("object.shape.kind=sphere", ("object", "shape"), {"kind": "sphere"}),
        ("obstacles.table.shape.kind=box", ("obstacles", 0, "shape"), {"kind": "box"}),
        ("objective.kind=payload", ("objective",), {"kind": "payload"}),
        ("constraints.collision=true", ("constraints", "collision"), True),
        ("world.gravity.z=-1.6", ("world", "gravity"), [0.0, 0.0, -1.6]),
        ("cases.one.quaternion=[1,0]", ("cases", 0), {"name": "one", "quaternion": [1, 0]}),
        ("name=1\nb = 2", ("name",), "1\nb = 2"),
    ],
)  # fmt: skip
def test_one_key(text: str, path: tuple, value: object) -> None:
    before = cell()
    after = overridden(before, dict([read_override(text)]))
    assert at(after, *path) == value
    assert before == cell()


def test_orientations_take_each_others_place() -> None:
    tables = overridden(cell(), {"object.quaternion": [0, 1, 0, 0]})
    assert "rpy" not in tables["object"]
    # A component of it starts from what the quaternion means.
    tables = overridden(tables, {"object.rpy.z": 0.5})["object"]
    assert tables["rpy"] == pytest.approx([math.pi, 0, 0.5]) and "quaternion" not in tables


def test_the_last_counts(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(two_pandas()))
    words = ["--set", "name=one", "--set", "name=two", "--set", "object.mass=1"]
    assert main(["check", str(file), *words]) == 0
    assert capsys.readouterr().out.startswith("two: spatial")
    words = ["--set", "object={mass=1}", "--set", "object.inertia=[1,1,1]", "--set", "object={}"]
    assert main(["check", str(file), *words]) == 2
    assert "object.mass: missing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("object.mas=1", "object.mas: unknown key; did you mean 'mass'?"),
        ("arms.rihgt.tip=a", "arms.rihgt.tip: none is called 'rihgt'; did you mean 'right'?"),
        ("arms.0.tip=a", "arms.0.tip: none is called '0'; allowed: le.ft, right"),
        ("object.position.w=1", "object.position.w: no component 'w' in 3; x, y, z or a number"),
        ("object.position.3=1", "object.position.3: no component '3' in 3"),
        ("object.mass.x=1", "object.mass.x: there is no 'x' in 2.0"),
        ("arms.right.start.0=1", "arms.right.start.0: start is not there to change a part of"),
        ("objective.kind=payloa", "objective.kind: 'payloa' is not allowed here"),
        ("object.mass", "--set: 'object.mass' is not KEY=VALUE, such as object.mass=3"),
        ("=3", "--set: '=3' is not KEY=VALUE"),
        ("object..mass=3", "--set: 'object..mass=3' is not KEY=VALUE"),
        (".".join("a" * 30) + "=1", "is not KEY=VALUE"),
    ],
)
def test_what_leads_nowhere(text: str, expected: str, tmp_path: Path, capsys) -> None:
    file = tmp_path / "p.toml"
    tables = cell()
    del tables["obstacles"], tables["cases"]
    file.write_text(toml(tables))
    assert main(["check", str(file), "--set", text]) == 2
    assert expected in capsys.readouterr().err


def test_a_grasp_is_taught_before(tmp_path: Path) -> None:
    tables = planar()
    for arm in tables["arms"]:
        del arm["grasp"]
        arm["start"] = [0.3, 0.4, 0.5]
    file = tmp_path / "p.toml"
    file.write_text(toml(tables))
    plain = copose.load(file)
    changes = {"arms.a1.base.position.x": -1.0, "object.position": [0.3, 0.3], "arms.a2.start.0": 1}
    moved = copose.load(file, set=changes)
    assert [arm.grasp for arm in moved.arms] == [arm.grasp for arm in plain.arms]
    assert moved.arms[0].base.position[0] == -1.0 and moved.object.position == (0.3, 0.3)


def test_objectives_and_directions(tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(toml(two_pandas()))
    problem = copose.load(file, direction=[0, 0, 2])
    assert problem.objective.kind == "task-compatibility"
    assert problem.objective.directions[0].direction == (0, 0, 2, 0, 0, 0)
    assert copose.load(file, objective="payload").objective.kind == "payload"
    fast = {"objective": {"kind": "acceleration", "direction": [1, 0, 0, 0, 0, 0]}}
    file.write_text(toml(two_pandas() | fast))
    up = copose.load(file, objective="acceleration", direction=[0, 0, 1]).objective
    assert up.wanted == ((0, 0, 1, 0, 0, 0),)
    assert copose.load(file, objective="isotropy").objective.kind == "isotropy"
    held = copose.load(file, objective="payload").objective
    assert held.direction is None and held.acceleration is None
    driven = {"kind": "payload", "direction": [0, 0, 1, 0, 0, 0], "acceleration": 2.0}
    file.write_text(toml(two_pandas() | {"objective": driven}))
    assert copose.load(file, objective="payload").objective == held
    sliced = {"objective": {"kind": "volume", "axes": ["roll", "pitch", "yaw"]}}
    file.write_text(toml(two_pandas() | sliced))
    assert copose.load(file, direction=[0, 0, 1]).objective.directions[0].direction == (0, 0, 1)
    with pytest.raises(InputError, match=r"objective\.direction: unknown key"):
        copose.load(file, objective="volume", direction=[0, 0, 1])


def test_commands_take_them(tmp_path: Path, capsys) -> None:
    tables = planar()
    for arm in tables["arms"]:
        del arm["grasp"]
        arm["start"] = [0.3, 0.4, 0.5]
    file = tmp_path / "p.toml"
    file.write_text(toml(tables))
    words = ["--set", "object.mass=3", "--direction", "0", "-1", "-o", str(tmp_path / "out")]
    assert main(["evaluate", str(file), "--json", *words]) == 0
    found = json.loads(capsys.readouterr().out)
    tables["object"] |= {"mass": 3}
    weighted = {"kind": "task-compatibility", "directions": [{"direction": [0, -1]}]}
    wanted = copose.evaluate(copose.parse(tables | {"objective": weighted}))
    assert found["objective"]["after"] == wanted.objective.after


def test_tables_may_hold_what_tomllib_gives() -> None:
    assert parse_complete(two_pandas()) == parse_complete(overridden(two_pandas(), {}))
