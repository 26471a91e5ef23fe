"""Where things are at the start, as `copose check` tells and draws it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import copose
from cells import PANDA, planar, tables, toml
from copose.commands.command_line import main
from copose.report.figures.start import start_figure
from copose.robots.files.file_paths import resolve


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def panda_pair(**right: object) -> dict:
    """Two Pandas with a start each, drawn at random."""
    cell = tables("two-panda-box")
    rng = np.random.default_rng(3)
    for arm in cell["arms"]:
        arm["start"] = rng.uniform([-1, -1, -1, -2, -1, 1, -1], [1, 1, 1, -1, 1, 2, 1]).tolist()
    cell["object"]["rpy"] = [0.1, -0.2, 0.3]
    cell["arms"][1] |= right
    return cell


def test_tips_and_misses_are_pinocchio_s() -> None:
    problem = copose.parse(panda_pair())
    model = pin.buildModelFromUrdf(str(resolve(PANDA, Path(), {})))
    data = model.createData()
    for start in copose.check(problem).starts:
        spec = next(arm for arm in problem.arms if arm.name == start.arm.name)
        q = pin.neutral(model)
        q[:7] = spec.start
        pin.framesForwardKinematics(model, data, q)
        base, thing = (
            pin.SE3(pin.rpy.rpyToMatrix(np.array(at.rpy)), np.array(at.position))
            for at in (spec.base, problem.object)
        )
        tip = base * data.oMf[model.getFrameId(spec.tip)]
        grasp = thing * pin.SE3(
            pin.rpy.rpyToMatrix(np.array(spec.grasp.rpy)), np.array(spec.grasp.position)
        )
        assert start.given
        np.testing.assert_allclose(start.tip.position, tip.translation, atol=1e-12)
        np.testing.assert_allclose(start.tip.rotation, tip.rotation, atol=1e-12)
        held = thing.inverse() * tip
        np.testing.assert_allclose(start.tip_in_object.rotation, held.rotation, atol=1e-12)
        np.testing.assert_allclose(start.tip_in_object.position, held.translation, atol=1e-12)
        gap = np.linalg.norm(tip.translation - grasp.translation)
        assert start.gap == pytest.approx(gap, abs=1e-12) and gap > 0.1
        turn = np.linalg.norm(pin.log3(grasp.rotation.T @ tip.rotation))
        assert start.turn == pytest.approx(turn, abs=1e-9) and not start.closed


def test_without_a_start_it_is_the_first_posture_of_the_seed() -> None:
    cell = tables("panda-lift")
    cell["objective"] = {"kind": "volume"}
    starts = copose.check(copose.parse(cell)).starts
    solution = copose.solve(copose.parse(cell), effort="low")
    for start in starts:
        assert start.closed and not start.given
        np.testing.assert_allclose(start.joints, solution.before.joints[start.arm.name], atol=1e-9)


def test_check_tells_by_how_much_each_arm_misses(here: Path, capsys) -> None:
    cell = planar()
    (here / "p.toml").write_text(toml(cell))
    assert main(["check", "p.toml"]) == 0
    assert "arm 'a1' has no start; a random posture holds" in capsys.readouterr().out
    cell["arms"][1]["base"]["position"] = [3.0, 0.1]
    (here / "p.toml").write_text(toml(cell))
    assert main(["check", "p.toml"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    missed = re.search(r"arm 'a2' .*misses by (\S+) m", out)
    starts = {start.arm.name: start for start in copose.check(copose.load("p.toml")).starts}
    assert float(missed[1]) == pytest.approx(starts["a2"].gap, rel=1e-2) and float(missed[1]) > 0.5
    for words in ("a1: tip", "a2: grasp", "world", "object", "angle, rad"):
        assert words in out


def test_check_draws_bodies_and_frames(here: Path, capsys) -> None:
    (here / "pandas.toml").write_text(toml(panda_pair()))
    (here / "flat.toml").write_text(toml(planar()))
    for name, named in (
        ("pandas", {"object", "left tip", "left grasp", "right tip", "right grasp"}),
        ("flat", {"object", "a1 tip", "a2 tip"}),
    ):
        assert main(["check", f"{name}.toml", "--figure", f"{name}.png"]) == 0
        assert (here / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        problem = copose.load(f"{name}.toml")
        starts = copose.check(problem).starts
        (ax,) = start_figure(problem, starts).axes
        assert {text.get_text() for text in ax.texts} == named
        if name == "pandas":
            # Some faces of every link, of each of the two robots, beside the object.
            (drawn,) = ax.collections
            (sticks,) = start_figure(problem, starts, bodies=False).axes[0].collections
            faces, fewer = (len(each.get_facecolor()) for each in (drawn, sticks))
            assert faces - fewer >= 2 * 9 * 10
    out, err = capsys.readouterr()
    assert "written to flat.png" in out and err == ""


def test_figures_of_no_known_format_are_refused_before_anything_runs(here: Path, capsys) -> None:
    (here / "flat.toml").write_text(toml(planar()))
    assert main(["check", "flat.toml", "--figure", "a.jpg"]) == 2
    assert "a picture ends in" in capsys.readouterr().err and not (here / "a.jpg").exists()
