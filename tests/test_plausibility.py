"""Numbers that no robot has: told where something depends on them, refused where nothing can."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import copose
from cells import two_pandas
from copose.errors import InputError
from copose.poses import Array
from copose.problem import parse
from test_robots import problem_of, robot

KINEMATIC = {"kind": "velocity-volume"}


def inertial(mass: float, inertia: Array, com: str = "0 0 0.05") -> str:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    return (
        (
            f'<inertial><origin xyz="{com}"/><mass value="{mass!r}"/><inertia ixx="{xx!r}" '
            f'ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/></inertial>'
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )


def sound(**changed: object) -> str:
    """A robot without a doubtful number, but for what is changed of its links and joints."""
    bodies = {i: inertial(3 - i / 3, (0.02 - 0.002 * i) * np.diag([1, 0.9, 0.5])) for i in range(7)}
    limits = {
        i: f'<limit lower="-2" upper="2" effort="{80 - 9 * i}" velocity="3"/>' for i in range(7)
    }
    return robot(
        inertial=bodies | changed.pop("inertial", {}),
        limits=limits | changed.pop("limits", {}),
        **changed,
    )


def table(text: str, folder: Path, **more: object) -> dict:
    (folder / "robot.urdf").write_text(text)
    return problem_of("robot.urdf", start=[0.1 * i for i in range(7)]) | more


def notes(text: str, folder: Path, **more: object) -> str:
    return " | ".join(copose.check(parse(table(text, folder, **more), folder / "p.toml")).notes)


def turned(moments: tuple[float, float, float], seed: int = 3) -> Array:
    """A tensor with these principal moments about axes at random."""
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return axes @ np.diag(moments) @ axes.T


def test_a_sound_robot_has_no_note(tmp_path: Path) -> None:
    told = notes(sound(), tmp_path)
    assert told.count("arm 'arm'") == 0 and "armature" in told


def test_placeholders_are_told(tmp_path: Path) -> None:
    told = notes(robot(), tmp_path)
    assert "arm 'arm': all links have one mass, 1 kg" in told
    assert "arm 'arm': all links have one inertia" in told
    assert "look like placeholders: 10, 10, 10, 10, 10, 10, 10, one for all joints" in told
    # One link of another mass is no chance that six others agree, but no placeholder either.
    body = inertial(2.0, np.diag([0.02, 0.02, 0.01]))
    limit = '<limit lower="-2" upper="2" effort="11" velocity="3"/>'
    told = notes(robot(inertial={2: body}, limits={4: limit}), tmp_path)
    assert "one mass" not in told and "one inertia" not in told and "placeholders" not in told


def test_bodies_of_matter_are_never_doubted(tmp_path: Path) -> None:
    """Point masses anywhere in a link's box: their inertia is what a body can have."""
    rng = np.random.default_rng(5)
    box = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
    for _ in range(4):
        bodies = {}
        for i in range(7):
            mass = rng.uniform(0.1, 1, rng.integers(2, 6))
            at = (rng.uniform(-0.5, 0.5, (len(mass), 3))) * [0.1, 0.2, 0.3]
            com = mass @ at / mass.sum()
            off = at - com
            tensor = sum(
                m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(mass, off, strict=True)
            )
            place = " ".join(map(repr, com.tolist()))
            bodies[i] = inertial(float(mass.sum()), tensor, place) + box
        assert "arm 'arm'" not in notes(sound(inertial=bodies), tmp_path)


@pytest.mark.parametrize(
    ("moments", "mass", "expected"),
    [
        ((0.01, 0.011, 0.0214), 1.5, "'l3' breaks the triangle inequality: its principal moments "
         "are 0.01, 0.011, 0.0214 kg·m²"),
        ((0.01, 0.011, 0.0211), 1.5, ""),
        ((12e3, 18e3, 20e3), 3.0, "'l3' is that of a larger body: its radius of gyration is 81.6"),
        ((1.0, 1.0, 1.0), 1.0, "'l3' is that of a larger body: its radius of gyration is 1 m"),
        # Frames without a body to speak of, as many files have them.
        ((1e-6, 1e-6, 1e-6), 1e-6, ""),
        ((0.0, 0.0, 1e-6), 1e-6, ""),
    ],
)  # fmt: skip
def test_inertias_of_no_body(
    moments: tuple[float, float, float], mass: float, expected: str, tmp_path: Path
) -> None:
    told = notes(sound(inertial={3: inertial(mass, turned(moments))}), tmp_path)
    assert (expected in told) if expected else ("arm 'arm'" not in told)


def test_one_note_names_the_worst_link_and_counts_the_others(tmp_path: Path) -> None:
    bodies = {
        i: inertial(1.0, turned((0.01, 0.01, third)))
        for i, third in ((1, 0.03), (4, 0.05), (5, 0.04))
    }
    told = notes(sound(inertial=bodies), tmp_path)
    assert told.count("triangle inequality") == 1
    assert "link 'l4' breaks the triangle inequality" in told and "(and 2 more)" in told


def test_links_that_no_arm_moves_do_not_matter(tmp_path: Path) -> None:
    odd = inertial(1.0, np.diag([-1.0, 1.0, 9e3]))
    wheel = (
        f'<link name="wheel">{odd}</link><joint name="w" type="fixed"><parent link="base"/>'
        '<child link="wheel"/></joint>'
    )
    assert "wheel" not in notes(sound(more=wheel), tmp_path)


@pytest.mark.parametrize("body", [inertial(2.0, turned((-0.004, 0.02, 0.03))),
                                  inertial(2.0, -turned((0.01, 0.01, 0.01)))])  # fmt: skip
def test_negative_inertia_is_refused_by_its_link(body: str, tmp_path: Path) -> None:
    text = sound(inertial={2: body})
    with pytest.raises(InputError) as caught:
        notes(text, tmp_path)
    assert caught.value.key == "arms[0] (arm)"
    assert "the inertia of link 'l2' is negative" in str(caught.value)
    # Rounding is no refusal: a rod's smallest moment is zero.
    notes(sound(inertial={2: inertial(2.0, turned((-1e-6, 0.03, 0.03)))}), tmp_path)


def test_limits_beyond_any_robots(tmp_path: Path) -> None:
    limits = {
        i: f'<limit lower="-2" upper="2" effort="{effort}" velocity="{speed}"/>'
        for i, effort, speed in ((1, "1e6", "3"), (2, "2e9", "3e5"), (3, "99999", "1e5"))
    }
    told = notes(sound(limits=limits), tmp_path)
    assert "the torque limit of joint 'j1', 1e+06, is beyond any robot's (and 1 more)" in told
    assert "the speed limit of joint 'j2', 300000, is beyond any robot's" in told
    assert "'j3'" not in told


def test_results_tell_what_they_depend_on(tmp_path: Path) -> None:
    limits = {2: '<limit lower="-2" upper="2" effort="10" velocity="3e5"/>'}
    for objective, masses in (({"kind": "volume"}, True), (KINEMATIC, False)):
        cell = table(robot(limits=limits), tmp_path, objective=objective)
        del cell["arms"][0]["grasp"]
        cell["arms"][0]["grasp"] = {"position": [0, 0, 0]}
        told = " | ".join(copose.evaluate(parse(cell, tmp_path / "p.toml")).notes)
        assert ("one mass" in told) == ("one inertia" in told) == masses
        assert "one for all joints" in told
        assert "speed limit" not in told


def test_arms_of_which_the_same_is_said_share_a_note() -> None:
    cell = two_pandas()
    for arm in cell["arms"]:
        arm["torque_limits"] = [100.0] * 7
    told = [note for note in copose.check(parse(cell)).notes if "placeholders" in note]
    assert len(told) == 1 and told[0].startswith("arms 'left', 'right': torque limits")


@pytest.mark.parametrize(
    ("urdf", "tip", "odd"),
    [
        ("panda_description/urdf/panda.urdf", "panda_hand", ""),
        ("ur_description/urdf/ur10_robot.urdf", "tool0", ""),
        ("xarm_description/urdf/xarm7.urdf", "link7", ""),
        ("z1_description/urdf/z1.urdf", "link06", ""),
        # Its wrist has the inertia of a rod as long as the forearm, 42 cm.
        ("ur_description/urdf/ur5_robot.urdf", "tool0", "is that of a larger body"),
        ("simple_humanoid_description/urdf/simple_humanoid.urdf", "l_wrist", "one inertia, as"),
    ],
)
def test_robots_of_the_world(urdf: str, tip: str, odd: str) -> None:
    cell = problem_of(f"example-robot-data://{urdf}", tip=tip)
    told = [note for note in copose.check(parse(cell)).notes if note.startswith("arm 'arm': ")]
    bodies = [note for note in told if "limit" not in note]
    assert any(odd in note for note in bodies) if odd else not bodies
