"""The exact set against pycapacity, brute force and linear programs that are written here."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
import warnings

import numpy as np
import pytest
import scipy.spatial
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from copose.capability import exact_set
from copose.capability.exact_set import ExactSet

with warnings.catch_warnings():
    # Its own: numpy.matlib, and escapes in docstrings when it is first compiled.
    warnings.simplefilter("ignore")
    from pycapacity.robot import acceleration_polytope

UNITS = np.array([1.0, 1.0, 1.0, 30.0, 30.0, 30.0])
SLICES = [
    (2, (0,)), (2, (1, 0)), (3, (2,)), (3, (0, 1)), (3, (0, 1, 2)), (6, (4,)), (6, (5, 3)),
    (6, (0, 1, 2)), (6, (3, 4, 5)), (6, (4, 0, 2)),
]  # fmt: skip


def numbers(
    rng: np.random.Generator, m: int, N: int, share: float = 0.3
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """B, T and a c that the given share of the torques can bring about."""
    B = rng.normal(size=(m, N)) * UNITS[:m, None] * np.exp(rng.normal(size=N))
    T = rng.uniform(5, 90, N)
    return B, T, share * B @ (T * rng.uniform(-1, 1, N))


def farthest(B, T, c, rows, reward) -> float | None:
    """Max of rewardᵀz with B τ + c = rows z, |τ| ≤ T; None if there is none."""
    size = np.abs(B * T).sum(axis=1)
    answer = linprog(
        np.concatenate([np.zeros(len(T)), -np.asarray(reward, dtype=float)]),
        A_eq=np.hstack([B * T, -rows]) / size[:, None],
        b_eq=-c / size,
        bounds=[(-1, 1)] * len(T) + [(None, None)] * rows.shape[1],
        options={"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9},
    )
    assert answer.status in (0, 2)
    return -answer.fun if answer.status == 0 else None


def inside(B, T, c, axes, x) -> bool:
    """Whether there are torques for x."""
    shifted = c - np.eye(len(c))[:, list(axes)] @ x
    return farthest(B, T, shifted, np.zeros((len(c), 0)), []) is not None


def support(B, T, c, axes, u) -> float | None:
    return farthest(B, T, c, np.eye(len(c))[:, list(axes)], u)


def reach(B, T, c, axes, u) -> float | None:
    return farthest(B, T, c, np.eye(len(c))[:, list(axes)] @ u[:, None], [1.0])


def directions(rng: np.random.Generator, count: int, a: int) -> np.ndarray:
    u = rng.normal(size=(count, a))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def same(one: float | None, other: float | None, scale: float, tolerance: float = 1e-7) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= tolerance * scale


@pytest.mark.parametrize(("m", "N"), [(2, 2), (2, 7), (3, 3), (3, 8), (3, 14)])
def test_the_whole_set_is_pycapacitys(m: int, N: int) -> None:
    rng = np.random.default_rng(10 * m + N)
    B, T, c = numbers(rng, m, N)
    mine = ExactSet.of(B, T, c)
    theirs = acceleration_polytope(B, np.eye(N), T, -T)
    points = theirs.vertices.T + c
    size = np.abs(points - c).max(axis=0)
    for one, other in ((mine.vertices, points), (points, mine.vertices)):
        gaps = np.abs(one[:, None] - other[None]) / size
        assert gaps.max(axis=2).min(axis=1).max() < 1e-7
    count = 2 * sum(math.comb(N - 1, i) for i in range(m))
    assert len(mine.vertices) == count
    volume = 2**m * sum(
        abs(np.linalg.det(B[:, chosen] * T[list(chosen)]))
        for chosen in itertools.combinations(range(N), m)
    )
    assert scipy.spatial.ConvexHull(mine.vertices).volume == pytest.approx(volume, rel=1e-9)
    H, d = theirs.H, theirs.d.ravel()
    radius = (d - H @ -c).min()
    assert mine.residual_radius == pytest.approx(max(0.0, radius), rel=1e-9)
    for u in directions(rng, 20, m):
        assert mine.support(u) == pytest.approx((points @ u).max(), rel=1e-9)
        far = H @ u > 0
        assert mine.reach(3 * u) == pytest.approx(((d + H @ c)[far] / (H @ u)[far]).min(), rel=1e-8)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(2, 6), st.integers(0, 3), st.floats(0, 5), st.floats(0, 2), st.integers(0, 999))
def test_no_torque_leaves_it_and_its_corners_support_it(
    m: int, more: int, spread: float, share: float, seed: int
) -> None:
    """All 2^N corners of the box of torques; generators that differ in size up to 10⁵."""
    rng = np.random.default_rng(seed)
    N = m + more
    B, T, c = numbers(rng, m, N, share)
    B = B * rng.permutation(np.geomspace(1, 10**-spread, N))
    E = ExactSet.of(B, T, c)
    corners = np.array(list(itertools.product((-1, 1), repeat=N))) * T @ B.T + c
    within = (rng.uniform(-1, 1, (200, N)) * T) @ B.T + c
    assert E.contains(corners, 1e-9).all() and E.contains(within).all()
    assert E.contains(within.reshape(4, 50, m)).shape == (4, 50)
    H, d = E.half_spaces
    assert np.allclose(np.linalg.norm(H, axis=1), 1, atol=1e-12)
    # Every half-space is one of support: none too far, none too near.
    reached = (corners @ H.T).max(axis=0)
    assert np.allclose(reached, d, rtol=1e-9, atol=1e-9 * np.abs(corners).max())
    for u in directions(rng, 5, m):
        top = corners[np.argmax(corners @ u)]
        assert abs(E.support(7 * u) - top @ u) <= 1e-9 * np.abs(corners).max()
        assert not E.contains(c + (1 + 1e-6) * (top - c))
        assert E.contains(c + (1 + 1e-6) * (top - c), 1e-5)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.sampled_from(SLICES),
    st.integers(0, 8),
    st.sampled_from([0.0, 0.3, 0.8, 1.5]),
    st.floats(0, 3),
    st.integers(0, 999),
)
def test_a_slice_reaches_as_far_as_linear_programs_say(
    which: tuple[int, tuple[int, ...]], more: int, share: float, spread: float, seed: int
) -> None:
    m, axes = which
    rng = np.random.default_rng(seed)
    N = m + more
    B, T, c = numbers(rng, m, N, share)
    B = B * rng.permutation(np.geomspace(1, 10**-spread, N))
    E = ExactSet.of(B, T, c, axes)
    H, d = E.half_spaces
    a = len(axes)
    for u in directions(rng, 4, a):
        top, low = support(B, T, c, axes, u), support(B, T, c, axes, -u)
        far, back = reach(B, T, c, axes, u), reach(B, T, c, axes, -u)
        assert (top is None) == E.empty
        if top is None or low is None:
            with pytest.raises(ValueError, match="empty"):
                E.support(u)
            assert E.reach(u) is None and E.vertices.shape == (0, a) and E.residual_radius == 0
            continue
        # What half-spaces, the corners and the linear programs of the set say, one by one.
        size = top + low
        assert same(E.support(2 * u), top, size)
        assert same((E.vertices @ u).max(), top, size)
        assert same(E.reach(2 * u), far, abs(far or 0) + size)
        ahead, behind = H @ u > 1e-12, H @ u < -1e-12
        end = (d[ahead] / (H @ u)[ahead]).min()
        start = (d[behind] / (H @ u)[behind]).max()
        if far is None or back is None:
            assert start > end
        else:
            assert same(end, far, abs(far) + size) and same(-start, back, abs(back) + size)


@pytest.mark.parametrize(("m", "axes"), SLICES)
def test_points_of_a_slice_are_those_with_torques(m: int, axes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(m + sum(axes))
    B, T, c = numbers(rng, m, m + 4)
    E = ExactSet.of(B, T, c, axes)
    corners = E.vertices
    assert E.contains(corners, 1e-9).all() and not E.contains(corners, -1e-6).any()
    mixed = rng.dirichlet(np.full(len(corners), 0.3), 20) @ corners
    middle = corners.mean(axis=0)
    edge = 0.7 * corners[rng.integers(len(corners), size=20)] + 0.3 * mixed
    around = middle + (edge - middle) * rng.uniform(0.6, 1.8, (20, 1))
    for x in mixed:
        assert E.contains(x, 1e-9) and inside(B, T, c, axes, x)
    truth = [inside(B, T, c, axes, x) for x in around]
    assert E.contains(around).tolist() == truth and len(set(truth)) == 2
    H, d = E.half_spaces
    assert (
        np.all(mixed @ H.T <= d + 1e-9 * np.abs(d))
        and truth == np.all(around @ H.T <= d, axis=1).tolist()
    )


@pytest.mark.parametrize(("m", "axes"), SLICES)
def test_the_ball_about_rest_is_inside_and_touches(m: int, axes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(m + sum(axes))
    B, T, c = numbers(rng, m, m + 5)
    E = ExactSet.of(B, T, c, axes)
    radius = E.residual_radius
    assert radius > 0
    around = directions(rng, 25, len(axes))
    for u in around:
        assert inside(B, T, c, axes, 0.999999 * radius * u)
        assert reach(B, T, c, axes, u) >= radius * (1 - 1e-7)
    H, d = E.half_spaces
    touching = H[np.argmin(d)]
    assert reach(B, T, c, axes, touching) == pytest.approx(radius, rel=1e-7)


def hand_made(c: tuple[float, float]) -> ExactSet:
    """{x = τ_1 + c_1 : τ_1 + τ_2 + c_2 = 0, |τ_1| ≤ 1, |τ_2| ≤ 0.5}."""
    return ExactSet.of([[1.0, 0.0], [1.0, 1.0]], [1.0, 0.5], c, [0])


def test_a_slice_by_hand_is_not_the_shadow() -> None:
    """The shadow is [−0.9, 1.1]."""
    E = hand_made((0.1, 0.2))
    assert np.allclose(E.vertices, [[-0.6], [0.4]], atol=1e-12)
    assert E.reach([1]) == pytest.approx(0.4) and E.reach([-1]) == pytest.approx(0.6)
    assert E.support([1]) == pytest.approx(0.4) and E.support([-2]) == pytest.approx(0.6)
    assert E.residual_radius == pytest.approx(0.4) and not E.empty
    assert E.contains([[0.39], [0.41], [-0.59], [-0.61], [np.nan]]).tolist() == [
        True, False, True, False, False,
    ]  # fmt: skip


def test_rest_outside_has_no_ball_and_a_reach_behind_it() -> None:
    E = hand_made((1.2, 0.0))
    assert np.allclose(E.vertices, [[0.7], [1.7]], atol=1e-12)
    assert E.reach([1]) == pytest.approx(1.7) and E.reach([-1]) == pytest.approx(-0.7)
    assert E.residual_radius == 0 and not E.empty and not E.contains([0.0])
    square = ExactSet.of(np.eye(2), [1, 1], [0.0, 3.0])
    assert square.reach([1, 0]) is None and square.reach([0, 1]) == 4
    assert square.reach([0, -1]) == -2 and square.residual_radius == 0


@pytest.mark.parametrize("most", [10**6, 0])
def test_an_empty_slice_and_one_that_is_a_point(monkeypatch, most: int) -> None:
    monkeypatch.setattr(exact_set, "_MOST", most)
    E = hand_made((0.3, 1.6))
    assert E.empty and E.vertices.shape == (0, 1) and E.residual_radius == 0
    assert E.reach([1]) is None and not E.contains([[0.0], [-0.7]]).any()
    with pytest.raises(ValueError, match="empty"):
        E.support([1])
    point = hand_made((0.3, 1.5))
    assert not point.empty and point.vertices.shape == (0, 1)
    assert point.support([1]) == pytest.approx(-0.7) and point.residual_radius == 0
    # Of this one even the half-spaces say so that leave x out.
    box = ExactSet.of(np.eye(3), np.ones(3), [0.0, 0.0, 1.1], [0, 1])
    assert box.empty and box.residual_radius == 0 and box.vertices.shape == (0, 2)
    if most:
        H, d = box.half_spaces
        assert linprog([0.0, 0.0], A_ub=H, b_ub=d, bounds=(None, None)).status == 2


def test_boxes_have_their_corners_whatever_else_is_parallel() -> None:
    """Equal, opposite and zero columns: dependent choices of them add no facet and lose none."""
    B = np.hstack([np.eye(3), -np.eye(3), np.eye(3)[:, :1], np.zeros((3, 2))])
    T = np.array([1.0, 2.0, 3.0, 0.5, 0.5, 0.5, 1.0, 9.0, 9.0])
    E = ExactSet.of(B, T, [0.5, 0.0, 0.0])
    assert sorted(map(tuple, np.round(E.vertices, 9))) == sorted(
        itertools.product((-2.0, 3.0), (-2.5, 2.5), (-3.5, 3.5))
    )
    assert E.residual_radius == pytest.approx(2.0)
    H, d = E.half_spaces
    assert d.max() == pytest.approx(3.5)
    assert len(np.unique(np.round(H, 9), axis=0)) == 6 and np.allclose(np.abs(H).max(axis=1), 1)


@pytest.mark.parametrize("stretch", [1, 10, 1000])
@pytest.mark.parametrize("m", [2, 3])
def test_a_corner_of_many_facets_is_told_once(m: int, stretch: float) -> None:
    """Generators of small integers, many in a plane, stretched: a corner is a vector of signs."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        N = int(rng.integers(m, 12))
        Z = np.hstack([np.eye(m), rng.integers(-2, 3, size=(m, N - m))])
        one, other = (np.linalg.qr(rng.normal(size=(m, m)))[0] for _ in range(2))
        B = one @ np.diag(np.geomspace(1, stretch, m)) @ other @ Z
        E = ExactSet.of(B, np.ones(N), rng.normal(size=m))
        signs = rng.normal(size=(50_000, m)) @ Z > 0
        assert len(E.vertices) == len(np.unique(signs @ 2 ** np.arange(N)))


def test_pieces_that_are_worked_on_one_by_one_make_the_same_set(monkeypatch) -> None:
    B, T, c = numbers(np.random.default_rng(6), 6, 11)
    points = directions(np.random.default_rng(7), 40, 3) * 500
    whole = ExactSet.of(B, T, c, [0, 1, 2])
    within = whole.contains(points)
    assert whole.half_spaces is not None and 0 < within.sum() < 40
    monkeypatch.setattr(exact_set, "_CHUNK", 25)
    pieces = ExactSet.of(B, T, c, [0, 1, 2])
    assert pieces.contains(points).tolist() == within.tolist()
    for one, other in zip(whole.half_spaces, pieces.half_spaces, strict=True):
        assert np.allclose(one, other, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("axes", [(0, 1), (1, 0), (5, 2)])
def test_corners_in_a_plane_go_counter_clockwise(axes: tuple[int, int]) -> None:
    B, T, c = numbers(np.random.default_rng(4), 6, 12)
    x, y = ExactSet.of(B, T, c, axes).vertices.T
    turns = (np.roll(x, -1) - x) * (np.roll(y, -2) - np.roll(y, -1)) - (np.roll(y, -1) - y) * (
        np.roll(x, -2) - np.roll(x, -1)
    )
    assert np.all(turns > 0)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.sampled_from(SLICES), st.floats(-5, 5), st.integers(0, 999))
def test_units_change_nothing_but_numbers(
    which: tuple[int, tuple[int, ...]], exponent: float, seed: int
) -> None:
    m, axes = which
    rng = np.random.default_rng(seed)
    B, T, c = numbers(rng, m, m + 4)
    units = 10.0 ** (exponent * rng.uniform(-1, 1, m))
    one, other = ExactSet.of(B, T, c, axes), ExactSet.of(units[:, None] * B, T, units * c, axes)
    scale = units[list(axes)]
    assert len(one.vertices) == len(other.vertices)
    for u in directions(rng, 5, len(axes)):
        value = (other.vertices @ (u / scale)).max()
        assert value == pytest.approx((one.vertices @ u).max(), rel=1e-7)
        moved = scale * u
        assert other.reach(moved) == pytest.approx(one.reach(u) * np.linalg.norm(moved), rel=1e-7)
    uniform = ExactSet.of(1e-4 * B, T, 1e-4 * c, axes)
    assert uniform.residual_radius == pytest.approx(1e-4 * one.residual_radius, rel=1e-9)


@pytest.mark.parametrize(
    ("m", "axes"), [*SLICES[1::2], (6, (0, 1, 2)), (6, (0, 1, 2, 3)), (6, (0, 1, 2, 3, 4, 5))]
)
def test_linear_programs_find_what_enumeration_finds(
    monkeypatch, m: int, axes: tuple[int, ...]
) -> None:
    rng = np.random.default_rng(m + 3 * sum(axes))
    B, T, c = numbers(rng, m, m + 6)
    exact = ExactSet.of(B, T, c, axes)
    assert exact.residual_radius > 0 and exact.half_spaces is not None
    corners = exact.vertices if len(axes) <= 3 else None
    monkeypatch.setattr(exact_set, "_MOST", 0)
    found = ExactSet.of(B, T, c, axes)
    assert found.half_spaces is None and not found.empty
    assert found.residual_radius == pytest.approx(exact.residual_radius, rel=1e-6)
    around = directions(rng, 20, len(axes)) * np.array([exact.reach(u) for u in np.eye(len(axes))])
    # Beside the boundary, on which rounding decides.
    around *= rng.uniform(0.6, 0.95, (20, 1)) ** rng.choice([-1, 1], (20, 1))
    assert found.contains(around).tolist() == exact.contains(around).tolist()
    if corners is None:
        return
    assert exact.contains(found.vertices, 1e-8).all()
    for u in directions(rng, 20, len(axes)):
        width = (corners @ u).max() - (corners @ u).min()
        gap = (corners @ u).max() - (found.vertices @ u).max()
        assert -1e-8 * width <= gap <= 0.04 * width


def test_six_arms_are_too_many_to_enumerate() -> None:
    rng = np.random.default_rng(0)
    B, T, c = numbers(rng, 6, 42, 0.1)
    E = ExactSet.of(B, T, c, [0, 1, 2])
    assert E.half_spaces is None
    for u in directions(rng, 20, 3):
        assert inside(B, T, c, E.axes, E.residual_radius * (1 - 1e-6) * u)
        assert E.reach(u) == pytest.approx(reach(B, T, c, E.axes, u), rel=1e-7)
    assert E.contains(E.vertices, 1e-8).all() and len(E.vertices) > 100
    outside = ExactSet.of(B, T, np.abs(B * T).sum(axis=1) * [1, 0, 0, 0, 0, 0], [0, 1, 2])
    assert outside.residual_radius == 0


def test_where_qhull_gives_up_there_are_linear_programs(monkeypatch) -> None:
    def refuses(*_: object) -> None:
        raise scipy.spatial.QhullError("QH6154")

    B, T, c = numbers(np.random.default_rng(3), 3, 7)
    exact = ExactSet.of(B, T, c).vertices
    monkeypatch.setattr(scipy.spatial, "HalfspaceIntersection", refuses)
    found = ExactSet.of(B, T, c).vertices
    gaps = np.abs(found[:, None] - exact[None]).max(axis=2).min(axis=1)
    assert len(found) > 20 and gaps.max() < 1e-7 * np.abs(exact).max()
    monkeypatch.setattr(scipy.spatial, "ConvexHull", refuses)
    assert ExactSet.of(B, T, c).vertices.shape == (0, 3)


@pytest.mark.parametrize(
    ("B", "T", "c", "axes", "why"),
    [
        (np.ones((2, 3)), np.ones(3), np.zeros(2), None, "flat"),
        ([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0]], np.ones(3), np.zeros(2), None, "flat"),
        (np.ones((3, 2)), np.ones(2), np.zeros(3), None, "flat"),
        ([[1.0, 1.0], [1.0, 1.0 + 1e-14]], np.ones(2), np.zeros(2), None, "flat"),
        (np.eye(2), [1.0, 0.0], np.zeros(2), None, "positive"),
        (np.eye(2), [1.0, -1.0], np.zeros(2), None, "positive"),
        (np.eye(2), [1.0, np.inf], np.zeros(2), None, "finite"),
        (np.full((2, 2), np.nan), np.ones(2), np.zeros(2), None, "finite"),
        (np.eye(2), np.ones(2), [0.0, np.nan], None, "finite"),
        (np.eye(2), np.ones(3), np.zeros(2), None, "takes"),
        (np.eye(2), np.ones(2), np.zeros(3), None, "takes"),
        (np.ones(2), np.ones(2), np.zeros(2), None, "takes"),
        (np.eye(2), np.ones(2), np.zeros(2), [], "axes"),
        (np.eye(2), np.ones(2), np.zeros(2), [0, 0], "axes"),
        (np.eye(2), np.ones(2), np.zeros(2), [2], "axes"),
        (np.eye(2), np.ones(2), np.zeros(2), [-1], "axes"),
    ],
)
def test_what_is_no_exact_set_is_refused(B, T, c, axes, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        ExactSet.of(B, T, c, axes)


def test_wrong_questions_are_refused() -> None:
    E = ExactSet.of(np.eye(4), np.ones(4), np.zeros(4))
    with pytest.raises(ValueError, match="at most 3 axes"):
        _ = E.vertices
    for ask in (E.support, E.reach):
        with pytest.raises(ValueError, match="direction"):
            ask(np.zeros(4))
        with pytest.raises(ValueError, match="4 axes, not 1"):
            ask([1.0])
    with pytest.raises(ValueError, match="read-only"):
        E.generators[0, 0] = 2.0


def test_scipy_is_loaded_where_it_is_used() -> None:
    code = "import sys, copose.capability.exact_set; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
