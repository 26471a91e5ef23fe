"""A .xacro is run without ROS; robot_descriptions is asked by name."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import copose
from copose.commands.command_line import main
from copose.errors import InputError
from copose.problem import parse
from copose.robots import load_arms

XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
ARM = f"""<robot name="arm" {XMLNS}>
  <xacro:arg name="length" default="0.3"/>
  <xacro:arg name="heavy" default="false"/>
  <xacro:include filename="$(find arm_parts)/urdf/link.xacro"/>
  <link name="l0"/>
  <xacro:link i="1" length="$(arg length)"/>
  <xacro:link i="2" length="$(arg length)"/>
  <xacro:link i="3" length="${{2 * float('$(arg length)')}}"/>
  <xacro:unless value="$(arg heavy)"><link name="tip"/></xacro:unless>
  <xacro:if value="$(arg heavy)">
    <link name="tip"><inertial><mass value="$(eval 2 + 3)"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  </xacro:if>
  <joint name="end" type="fixed"><parent link="l3"/><child link="tip"/></joint>
</robot>"""
LINK = f"""<robot {XMLNS}><xacro:macro name="link" params="i length">
  <joint name="j${{i}}" type="revolute"><parent link="l${{i - 1}}"/><child link="l${{i}}"/>
    <origin xyz="${{length}} 0 0"/><axis xyz="0 ${{i % 2}} ${{1 - i % 2}}"/>
    <limit lower="-2" upper="2" effort="10" velocity="1"/></joint>
  <link name="l${{i}}"><inertial><origin xyz="${{length / 2}} 0 0"/><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
</xacro:macro></robot>"""


def package(folder: Path, name: str, files: dict[str, str]) -> Path:
    (folder / "urdf").mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    for file, text in files.items():
        (folder / "urdf" / file).write_text(text)
    return folder


def cell(**arm: object) -> dict:
    thing = {"mass": 1.0, "position": [0.5, 0.0, 0.5]}
    table = {"name": "a", "tip": "tip", "grasp": {"position": [0, 0, 0]}, **arm}
    return {
        "format": 1, "name": "x", "task": {"space": "spatial-linear"}, "object": thing,
        "arms": [table],
    }  # fmt: skip


@pytest.mark.parametrize("where", ["packages", "ROS_PACKAGE_PATH", "beside", "above"])
def test_xacro_is_run(where: str, tmp_path: Path, monkeypatch, capfd) -> None:
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    main_ = package(tmp_path / "ws/arm", "arm_main", {"arm.urdf.xacro": ARM})
    more: dict[str, object] = {}
    if where == "above":
        (main_ / "package.xml").write_text("<package><name>arm_parts</name></package>")
        (main_ / "urdf/link.xacro").write_text(LINK)
    else:
        place = "ws/arm_parts" if where == "beside" else "elsewhere/arm_parts"
        package(tmp_path / place, "arm_parts", {"link.xacro": LINK})
        if where == "packages":
            more["packages"] = {"arm_parts": "elsewhere/arm_parts"}
        elif where == "ROS_PACKAGE_PATH":
            monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "elsewhere"))
    plain = cell(urdf="ws/arm/urdf/arm.urdf.xacro", **more)
    other = cell(
        urdf="ws/arm/urdf/arm.urdf.xacro", xacro_args={"length": 0.5, "heavy": True}, **more
    )
    for tables, length, mass in ((plain, 0.3, 1.0), (other, 0.5, 6.0)):
        (arm,) = load_arms(parse(tables, source=tmp_path / "p.toml"))
        assert arm.joint_names == ("j1", "j2", "j3")
        # By hand: joints at 1, 1 and 2 lengths, masses in the middle of each.
        assert np.allclose(arm.tip_at([0, 0, 0]).position, [4 * length, 0, 0], atol=1e-15)
        assert arm.joints[0].body.com[0] == pytest.approx(length / 2)
        assert arm.joints[2].body.mass == mass
        assert arm.notes == ("arm.urdf.xacro was run by xacro",)
    assert capfd.readouterr() == ("", "")


def test_check_says_so(tmp_path: Path, capsys) -> None:
    from cells import toml

    package(tmp_path / "arm_parts", "arm_parts", {"link.xacro": LINK, "arm.xacro": ARM})
    (tmp_path / "p.toml").write_text(toml(cell(urdf="arm_parts/urdf/arm.xacro")))
    assert main(["check", str(tmp_path / "p.toml")]) == 0
    assert "arm.xacro was run by xacro" in capsys.readouterr().out


def test_two_of_one_file_are_two_robots(tmp_path: Path) -> None:
    package(tmp_path / "arm_parts", "arm_parts", {"link.xacro": LINK, "arm.xacro": ARM})
    tables = cell(urdf="arm_parts/urdf/arm.xacro")
    one = tables["arms"][0]
    tables["arms"] = [one, one | {"name": "b", "xacro_args": {"length": "0.4"}}]
    first, second = load_arms(parse(tables, source=tmp_path / "p.toml"))
    assert first.tip_at([0, 0, 0]).position[0] == pytest.approx(1.2)
    assert second.tip_at([0, 0, 0]).position[0] == pytest.approx(1.6)
    tables["arms"][1]["xacro_args"] = {}
    with pytest.raises(InputError, match="are one robot and both hang on j1"):
        load_arms(parse(tables, source=tmp_path / "p.toml"))


def told(tables: dict, folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_arms(parse(tables, source=folder / "p.toml"))
    return str(caught.value)


def test_what_xacro_cannot_do(tmp_path: Path, monkeypatch, capfd) -> None:
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    for name, text, expected in [
        ("lost.xacro", ARM, "needs package 'arm_parts', which was not found; name its folder by"),
        ("broken.xacro", "<robot", "broken.xacro: xacro says: unclosed token"),
        ("wrong.xacro", f'<robot {XMLNS}><link name="${{a}}"/></robot>', "name 'a' is not defined"),
        ("arg.xacro", f'<robot {XMLNS}><link name="$(arg b)"/></robot>', "xacro says: Undefined"),
        ("call.xacro", f"<robot {XMLNS}><xacro:none/></robot>", "xacro says: unknown macro name"),
        ("plain.urdf", "<robot/>", "xacro_args have no effect: plain.urdf is no .xacro"),
    ]:
        (tmp_path / name).write_text(text)
        message = told(cell(urdf=name, xacro_args={"a": 1}), tmp_path)
        assert expected in message and "arms[0] (a).urdf: " in message
    assert "nope.xacro: no such file" in told(cell(urdf="nope.xacro"), tmp_path)
    assert capfd.readouterr().err == ""
    monkeypatch.setitem(sys.modules, "xacro", None)
    message = told(cell(urdf="lost.xacro"), tmp_path)
    assert "lost.xacro is xacro, which is not installed; pip install 'copose[xacro]'" in message


def test_a_urdf_is_never_run(tmp_path: Path) -> None:
    text = f'<robot name="r" {XMLNS}><xacro:include filename="{tmp_path}/x.xacro"/></robot>'
    (tmp_path / "arm.urdf").write_text(text)
    assert "is xacro, not URDF" in told(cell(urdf="arm.urdf"), tmp_path)


def test_robot_descriptions(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    wanted = cell(urdf="robot_descriptions://stand_in_description")
    assert "the package robot_descriptions is not installed; pip install" in told(wanted, tmp_path)
    monkeypatch.delitem(sys.modules, "robot_descriptions")
    package(tmp_path / "arm_parts", "arm_parts", {"link.xacro": LINK, "arm.xacro": ARM})
    stand_in = tmp_path / "site/robot_descriptions"
    stand_in.mkdir(parents=True)
    (stand_in / "__init__.py").write_text("")
    path = tmp_path / "arm_parts/urdf/arm.xacro"
    (stand_in / "stand_in_description.py").write_text(f"XACRO_PATH = {str(path)!r}\n")
    (stand_in / "far_description.py").write_text("raise OSError('no network\\nat all')\n")
    (stand_in / "bare_description.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    try:
        assert load_arms(parse(wanted))[0].n == 3
        for name, expected in [
            ("stand_in_descriptio", "did you mean 'stand_in_description'?"),
            ("far_description", "robot_descriptions cannot fetch far_description: no network at"),
            ("bare_description", "robot_descriptions has no file of bare_description"),
            ("../x", "robot_descriptions has no '../x'"),
        ]:
            assert expected in told(cell(urdf=f"robot_descriptions://{name}"), tmp_path)
    finally:
        for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
            del sys.modules[name]


def test_taught_from_xacro(tmp_path: Path) -> None:
    package(tmp_path / "arm_parts", "arm_parts", {"link.xacro": LINK, "arm.xacro": ARM})
    tables = cell(urdf="arm_parts/urdf/arm.xacro", start=[0.1, 0.2, 0.3])
    del tables["arms"][0]["grasp"], tables["object"]["position"]
    after = copose.evaluate(copose.parse(tables, source=tmp_path / "p.toml")).after
    assert after is not None and after.closure_error["a"] < 1e-12
