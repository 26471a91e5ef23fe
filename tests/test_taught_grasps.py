"""Arms with a start and no grasp hold the object where their tips are."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import copose
from cells import two_pandas
from copose.errors import InputError
from copose.problem import case_problems
from copose.problem import parse as parse_complete
from made_starts import NAMES, drawn

SPACES = ("spatial", "spatial-linear", "planar", "planar-linear")


@pytest.mark.parametrize("between", [True, False], ids=["between", "placed"])
@pytest.mark.parametrize("name", [*NAMES, "links"])
def test_grasps_are_where_the_tips_are(name: str, between: bool) -> None:
    rng = np.random.default_rng(7)
    for _ in range(2):
        taught, written = drawn(name, "planar" if name == "links" else "spatial", rng, between)
        one, two = copose.parse(taught), parse_complete(written)
        assert np.abs(np.subtract(one.object.position, two.object.position)).max() < 1e-12
        for arm, other in zip(one.arms, two.arms, strict=True):
            assert np.abs(arm.grasp.pose.position - other.grasp.pose.position).max() < 1e-12
            assert np.abs(arm.grasp.pose.rotation - other.grasp.pose.rotation).max() < 1e-12


@pytest.mark.parametrize("space", SPACES)
def test_a_taught_posture_closes_and_measures_as_the_same_written_out(space: str) -> None:
    taught, written = drawn("ur5", space, np.random.default_rng(3), between=True)
    one, two = (copose.evaluate(copose.parse(each)) for each in (taught, written))
    assert one.after is not None and two.after is not None
    assert max(one.after.closure_error.values()) < 1e-12
    for key in ("gram", "center", "radii"):
        a, b = (np.array(getattr(each.after.ellipsoid, key)) for each in (one, two))
        assert np.allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())
    assert one.objective.after == pytest.approx(two.objective.after, rel=1e-9)


def half_taught() -> dict:
    cell = two_pandas()
    cell["arms"][0]["start"] = [0, -0.4, 0, -2.2, 0, 1.8, 0.8]
    del cell["arms"][0]["grasp"]
    return cell


def test_what_is_moved_later_leaves_the_grasp() -> None:
    cell = half_taught()
    plain = copose.parse(cell).arms[0].grasp
    other = copy.deepcopy(cell)
    other["cases"] = [{"name": "far", "position": [0.6, 0.1, 0.4], "rpy": [0.1, 0.2, 0.3]}]
    other["object"]["freedom"] = {"x": [-0.1, 0.1]}
    problem = copose.parse(other)
    assert problem.arms[0].grasp == plain
    assert case_problems(problem)[0].arms[0].grasp == plain
    along = cell | {"path": {"waypoints": [{"position": [0.6, 0.1, 0.4]}, {}]}}
    assert copose.parse(along).arms[0].grasp == plain


def test_a_grasp_that_is_written_stays_beside_a_start() -> None:
    cell = half_taught()
    cell["arms"][1]["start"] = cell["arms"][0]["start"]
    written = parse_complete(two_pandas()).arms[1].grasp
    assert copose.parse(cell).arms[1].grasp == written


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda c: c["object"].pop("position"), "object.position: missing; only where every arm's"),
        (lambda c: c["arms"][0].pop("start"), "arms[0] (left).grasp: missing; a start without it"),
        (lambda c: c["arms"][0].update(start=[0] * 6), "arms[0] (left).start: has 6 entries; 7"),
        (lambda c: c["arms"][0].update(start=[9] * 7), "arms[0] (left).start[0]: 9.0 is outside"),
        (lambda c: c["arms"][0].update(tip="hand"), "arms[0] (left).tip: 'hand' is no link"),
        (lambda c: c["arms"][0].update(start=True), "arms[0] (left).start: true must be an array"),
        (lambda c: c.update(object=3), "object: 3 must be a table"),
        (lambda c: c.update(arms=[3]), "arms[0]: 3 must be a table"),
    ],
    ids=["position", "start", "short", "limits", "tip", "true", "object", "arms"],
)
def test_what_cannot_be_taught(change, expected: str) -> None:
    cell = half_taught()
    change(cell)
    with pytest.raises(InputError) as caught:
        copose.parse(cell)
    assert expected in str(caught.value)
