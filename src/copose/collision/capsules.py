"""Few capsules that enclose a triangle mesh, or the convex hull of points.

A capsule K with both ends in a convex body C sticks out of it by r − min(depth(a), depth(b)), depth
the distance to the nearest face: the distance to C is a convex function, so over K it is greatest
at an end, and a ball about a point in C sticks out most across the nearest face. Candidates have as
large a radius as that allows, for ends in many places; of them as few are chosen as together hold
samples of what is to be enclosed. What they leave out becomes samples, until they leave nothing
out. Then each is made as small as its share allows.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from copose.poses import Array, Indices, Mask, frozen_array

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

_Bits: TypeAlias = NDArray[np.uint64]
_Numbers = TypeVar("_Numbers", NDArray[np.float32], Array)
_Ends: TypeAlias = tuple[Array, Array]
_Found: TypeAlias = tuple[Array, Array, float]

# What a capsule may stick out, m, unless told otherwise.
MOST = 0.02
# Added to radii, m: rounding leaves no point outside.
_ROUNDING = 1e-9
# Extents below this share of the largest, or of `most`, are none: the points are flat, on a line,
# or one, and capsules are larger by what they are off.
_FLAT = 1e-7
_THIN = 1e-3
# Share of `most` by which samples must be inside: what lies that near to one is inside as well.
# More in three dimensions, where so small simplices would be many.
_HELD_BACK = {2: 0.02, 3: 0.08}
# Edges of simplices with a corner in no capsule that are not halved, in units of that.
_HOLE = 8.0
# A mesh is cut where that makes its convex hulls smaller by this share of their volume, at these
# shares of its extent, and into 2³ parts at most.
_GAIN = 0.25
_SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
_CUTS = 3
# Samples of a body: about so many, more where they would be farther apart than `most`.
_SAMPLES = 400
_SAMPLES_MOST = 1500
# Depths of ends in units of `most`; 1.37 and 2.41 reach into corners and along edges of boxes.
_DEPTHS = (0.45, 0.8, 1.1, 1.35, 1.8, 2.4, 3.2, 4.3, 5.8, 7.8, 10.5, 14.0, 19.0, 25.0)
# Corners of a body and ends of one depth that are joined with each other.
_CORNERS = 100
_ENDS = 12
# Faces by which a body is found to be long or broad in some directions.
_LARGE = 300
# Chords of one depth and direction: how far apart in units of the radius, how many at most in all,
# and how many less one at most in a row.
_APART = 0.5
_CHORDS = 300
_GRID = 40
# Rounds in which candidates are varied before samples are added, and rounds in which they are.
_VARIED = 3
_ROUNDS = 24
# Rounds with samples added in which the choice may still exchange what it has, not only add.
_EXCHANGING = 14
# Variants of each chosen candidate, how far they shrink from round to round, and candidates kept
# for each sample.
_VARIANTS = 80
_SHRINK = 0.7
_KEPT = 12
# New samples of a round.
_NEW = 200
# First choices that are tried, triples of choices, and candidates for the first of the two instead.
_STARTS = 5
_TRIPLES = 24
_PARTNERS = 100
# Masks to count bits with.
_PAIRS, _FOURS, _EIGHTS, _BYTES = (
    np.uint64(x * 0x0101010101010101) for x in (0x55, 0x33, 0x0F, 0x01)
)
# Steps in which a capsule is fitted.
_STEPS = 60


@dataclass(frozen=True, eq=False)
class Capsule:
    """All points within ``radius`` of the segment from a to b.

    Attributes:
        a: one end of the axis, m, shape (3,).
        b: the other end; where it is a itself, the capsule is a ball.
        radius: m, positive.
    """

    a: Array
    b: Array
    radius: float


def around_surface(vertices: Array, triangles: Indices, most: float = MOST) -> tuple[Capsule, ...]:
    """Capsules K_i with every triangle in ∪ K_i, each K_i within `most` of a part's convex hull.

    A mesh that is far from convex is cut into parts first, so that capsules follow it; the others
    are one part. What a mesh encloses need not be in ∪ K_i.

    Args:
        vertices: m, (n, 3).
        triangles: indices of vertices, (k, 3).
        most: what a capsule may stick out, m.

    Raises:
        ValueError: shapes, indices or numbers do not make a mesh, or `most` is not positive.
    """
    V = _checked(vertices, most)
    T = np.asarray(triangles)
    if T.ndim != 2 or T.shape[1] != 3 or not len(T) or not np.issubdtype(T.dtype, np.integer):
        raise ValueError("a surface takes triangles (k, 3) of indices, k > 0")
    if T.min() < 0 or T.max() >= len(V):
        raise ValueError("the triangles of a surface must be of its vertices")
    used, place = np.unique(T, return_inverse=True)
    space = _Space.of(V[used], most)
    X = space.inward(V[used])
    if space.size < 2:
        return space.outward([space.line(X)])
    simplices = X[place.reshape(-1, 3)]
    if space.size == 2:
        return space.outward(_cover([simplices], [_Body.of(X, thick=False)], most - 2 * space.off))
    parts = _parts(simplices, most, _CUTS)
    return space.outward(_cover(parts, [_Body.of(_distinct(part)) for part in parts], most))


def around_hull(vertices: Array, most: float = MOST) -> tuple[Capsule, ...]:
    """Capsules K_i with conv(vertices) ⊂ ∪ K_i, each K_i within `most` of conv(vertices).

    Points that all have z = 0 are a planar polygon: axes are in the plane z = 0, and what sticks
    out is measured in that plane only. Other flat sets are sheets in space.

    Args:
        vertices: m, (n, 3).
        most: what a capsule may stick out, m.

    Raises:
        ValueError: the vertices are none, not (n, 3) or not finite, or `most` is not positive.
    """
    V = _checked(vertices, most)
    space = _Space.of(V, most)
    X = space.inward(V)
    if space.size < 2:
        return space.outward([space.line(X)])
    body = _Body.of(X, thick=space.size == 3 or bool(np.all(V[:, 2] == 0)))
    apex = np.broadcast_to(body.middle, (len(body.faces), 1, space.size))
    solid = np.concatenate([body.corners[body.faces], apex], axis=1)
    return space.outward(_cover([solid], [body], most - 2 * space.off))


def _checked(vertices: ArrayLike, most: float) -> Array:
    V = np.asarray(vertices, dtype=float)
    if V.ndim != 2 or V.shape[1] != 3 or not len(V) or not np.all(np.isfinite(V)):
        raise ValueError("capsules are around finite points (n, 3), n > 0")
    if not (np.isfinite(most) and most > 0):
        raise ValueError("what a capsule may stick out must be positive")
    return V


@dataclass(frozen=True, eq=False)
class _Space:
    """{origin + basisᵀ x}: the point, line, plane or all of space that some points span.

    Attributes:
        origin: (3,).
        basis: orthonormal rows, (q, 3).
        off: greatest distance of the points from it.
    """

    origin: Array
    basis: Array
    off: float

    @classmethod
    def of(cls, V: Array, most: float) -> _Space:
        origin = V.mean(axis=0)
        X = V - origin
        least = max(_FLAT * float(np.ptp(V, axis=0).max()), _THIN * most)
        # Principal axes where they show that the points span less; coordinates keep z = 0 as it is.
        bases = [
            axes[np.ptp(_dots(X, axes), axis=0) > least] for axes in (np.eye(3), _principal(X))
        ]
        basis = min(bases, key=len)
        rest = X - np.einsum("nj,kj,ki->ni", X, basis, basis)
        off = float(np.linalg.norm(rest, axis=1).max()) if len(basis) < 3 else 0.0
        return cls(origin, basis, off)

    @property
    def size(self) -> int:
        """Dimension q."""
        return len(self.basis)

    def inward(self, V: Array) -> Array:
        """X, (n, q), of V, (n, 3)."""
        return _dots(V - self.origin, self.basis)

    def line(self, X: Array) -> _Found:
        """The capsule along points of a line, (n, 1), or about one point, (n, 0)."""
        return X.min(axis=0), X.max(axis=0), 0.0

    def outward(self, found: Sequence[_Found]) -> tuple[Capsule, ...]:
        """Capsules in space, larger by what the points are off the plane, and for rounding."""
        return tuple(
            Capsule(
                frozen_array(self.origin + a @ self.basis),
                frozen_array(self.origin + b @ self.basis),
                r + self.off + _ROUNDING,
            )
            for a, b, r in found
        )


@dataclass(frozen=True, eq=False)
class _Body:
    """C = {x : H x ≤ d}, the convex hull of its corners.

    Attributes:
        corners: (k, q).
        faces: indices of corners, (f, q).
        H: unit rows, (f, q).
        d: (f,).
        thick: whether points may be deep inside; all depths are 0 in a sheet that lies in space.
    """

    corners: Array
    faces: Indices
    H: Array
    d: Array
    thick: bool

    @classmethod
    def of(cls, X: Array, thick: bool = True) -> _Body:
        """The convex hull of points, (n, q), that span q dimensions."""
        hull, joggled = _hull(X)
        q = X.shape[1]
        place = np.zeros(len(X), dtype=np.intp)
        place[hull.vertices] = np.arange(len(hull.vertices))
        H = hull.equations[:, :q]
        d = -hull.equations[:, q]
        if joggled:
            # Faces of joggled points do not hold every point.
            d = np.maximum(d, _dots(X, H).max(axis=0))
        return cls(X[hull.vertices], place[hull.simplices], H, d, thick)

    def depth(self, x: Array) -> Array:
        """Distance of points inside, (..., q), to the nearest face; negative outside."""
        depth = (self.d - _dots(x, self.H)).min(axis=-1)
        return np.asarray(depth if self.thick else np.minimum(depth, 0.0))

    @cached_property
    def middle(self) -> Array:
        """A point inside, (q,)."""
        return np.asarray(self.corners.mean(axis=0))

    @cached_property
    def frames(self) -> list[Array]:
        """Orthonormal rows along coordinates and, if these differ, along its largest faces."""
        q = self.corners.shape[1]
        edges = self.corners[self.faces[:, 1:]] - self.corners[self.faces[:, :1]]
        area = np.sqrt(np.abs(np.linalg.det(edges @ edges.transpose(0, 2, 1))))
        large = np.argsort(-area, kind="stable")[:_LARGE]
        area = area[large]
        rows: list[Array] = []
        for _ in range(q):
            N = self.H[large]
            for n in rows:
                N = N - _dots(N, n[None]) * n
            length = np.linalg.norm(N, axis=1)
            # Faces about perpendicular to those before.
            fit = np.flatnonzero(length >= min(0.95, float(length.max())))
            U = N[fit] / length[fit, None]
            weight = np.where(np.abs(_dots(U, U)) > 0.999, area[fit], 0.0).sum(axis=1)
            rows.append(U[int(weight.argmax())])
        F = np.array(rows)
        along = np.all(np.abs(F).max(axis=1) > 1 - 1e-6)
        return [np.eye(q)] if along else [np.eye(q), F]


@dataclass(frozen=True, eq=False)
class _Pool:
    """Capsules that may be chosen, none sticking out of its body by more than allowed.

    Attributes:
        a: one end of each, (k, q).
        b: the other.
        radius: (k,).
        body: index of the body of each, (k,).
    """

    a: Array
    b: Array
    radius: Array
    body: Indices

    @classmethod
    def within(cls, body: _Body, index: int, a: Array, b: Array, most: float) -> _Pool:
        """The largest capsules with ends at a and b that stick out by `most`."""
        radius = most + np.minimum(body.depth(a), body.depth(b))
        return cls(a, b, radius, np.full(len(a), index, dtype=np.intp))[radius > 0]

    @classmethod
    def joined(cls, pools: Sequence[_Pool]) -> _Pool:
        """All of several pools."""
        return cls(
            np.concatenate([pool.a for pool in pools]),
            np.concatenate([pool.b for pool in pools]),
            np.concatenate([pool.radius for pool in pools]),
            np.concatenate([pool.body for pool in pools]),
        )

    def __getitem__(self, k: Indices | Mask) -> _Pool:
        return _Pool(self.a[k], self.b[k], self.radius[k], self.body[k])

    def holds(self, X: Array, back: float) -> Mask:
        """Which points, (m, q), each capsule holds if its radius is `back` less: (k, m)."""
        # About their middle, single precision is fine enough for a choice.
        centre = X.mean(axis=0)
        Y = (X - centre).astype(np.float32)
        a, e = (self.a - centre).astype(np.float32), (self.b - self.a).astype(np.float32)
        square = np.maximum((e * e).sum(axis=1), np.float32(1e-12))[:, None]
        far = (a * a).sum(axis=1)[:, None] + (Y * Y).sum(axis=1) - 2 * _dots(a, Y)
        along = _dots(e, Y) - (a * e).sum(axis=1)[:, None]
        t = np.clip(along / square, 0, 1)
        far -= t * (2 * along - t * square)
        reach = np.maximum(self.radius - back, 0.0).astype(np.float32)
        return np.asarray(far <= (reach**2)[:, None])

    def varied(self, bodies: list[_Body], size: float, most: float) -> _Pool:
        """Capsules with ends within about `size` of these; the same each time."""
        rng = np.random.default_rng(0)
        pools = []
        for k in range(len(self.a)):
            body = bodies[self.body[k]]
            room = body.d - _dots(body.H, body.middle[None])[:, 0]
            ends = []
            for end in (self.a[k], self.b[k]):
                steps = size * rng.normal(size=(_VARIANTS, len(end)))
                # Some ends stay, and some move little.
                steps *= rng.random((_VARIANTS, 1)) * (rng.random((_VARIANTS, 1)) < 0.7)
                # What is outside goes back towards the middle, to just inside.
                out = end + steps - body.middle
                share = (_dots(out, body.H) / room).max(axis=1)
                ends.append(body.middle + out / np.maximum((1 + 1e-9) * share, 1.0)[:, None])
            pools.append(_Pool.within(body, int(self.body[k]), ends[0], ends[1], most))
        return _Pool.joined(pools)


def _cover(parts: list[Array], bodies: list[_Body], most: float) -> list[_Found]:
    """Capsules that hold all simplices of parts, (m_i, s, q), each within `most` of a part's body.

    Candidates are varied about the chosen ones from round to round. What is not held after all
    rounds is halved until one capsule holds it.
    """
    most = max(most - 2 * _ROUNDING, most / 2)
    if len(parts) == 1:
        a, b, r, p = _fitted(bodies[0].corners, bodies[0])
        if p <= most:
            return [(a, b, r)]
    simplices = np.concatenate(parts)
    samples = [_samples(part, most) for part in parts]
    for body in bodies:
        samples.append(body.corners[_spread(body.corners, 60)])
        if simplices.shape[1] > simplices.shape[2]:
            # A solid is missed at its surface more often than inside.
            samples.append(_samples(body.corners[body.faces], most))
    X = np.concatenate(samples)
    back = _HELD_BACK[simplices.shape[1] - 1] * most
    pool = _Pool.joined([_candidates(body, k, most) for k, body in enumerate(bodies)])
    M = pool.holds(X, back)
    size = 0.25 * most + 0.05 * float(np.ptp(X, axis=0).max())
    chosen = np.zeros(0, dtype=np.intp)
    pieces: list[Array] = []
    for k in range(_VARIED + _ROUNDS):
        chosen = _fewest(M, None if k < _VARIED else chosen, k < _VARIED + _EXCHANGING)
        if k >= _VARIED:
            enough = _NEW if k + 1 < _VARIED + _ROUNDS else None
            pieces, missed = _shared(simplices, pool[chosen], back, enough)
            if not len(missed):
                break
            missed = missed[_spread(missed, _NEW)]
            X = np.vstack([X, missed])
            M = np.hstack([M, pool.holds(missed, back)])
        if k + 1 == _VARIED + _ROUNDS:
            break
        kept = _useful(M, chosen)
        more = pool[chosen].varied(bodies, size * _SHRINK**k, most)
        pool, M = _Pool.joined([pool[kept], more]), np.vstack([M[kept], more.holds(X, back)])
        # The chosen are the first that are kept.
        chosen = np.arange(len(chosen))
    found: list[_Found] = []
    for c, piece in zip(chosen, pieces, strict=True):
        if len(piece):
            start = pool.a[c], pool.b[c]
            found += _around(piece, bodies[pool.body[c]], bodies, most, start)
    return found


def _around(
    piece: Array, body: _Body, bodies: list[_Body], most: float, start: _Ends | None
) -> list[_Found]:
    """Capsules around simplices, (m, s, q): one from a start if that holds them, else of halves."""
    X = _outermost(_distinct(piece))
    if start is not None:
        a, b, r, p = _fitted(X, body, start)
        if p <= most:
            return [(a, b, r)]
        a, b = start
        r = float(_distances(X, a[None], b[None]).max())
        if r - float(body.depth(np.array(start)).min()) <= most:
            return [(a, b, r)]
    for other in bodies:
        a, b, r, p = _fitted(X, other)
        if p <= most:
            return [(a, b, r)]
    s = piece.mean(axis=1)
    axis = int(np.ptp(s, axis=0).argmax())
    low = s[:, axis] <= (s[:, axis].min() + s[:, axis].max()) / 2
    if low.all():
        piece = _halved(piece)
        low = np.arange(len(piece)) < len(piece) // 2
    return [
        c for side in (piece[low], piece[~low]) for c in _around(side, body, bodies, most, None)
    ]


def _shared(
    simplices: Array, capsules: _Pool, back: float, enough: int | None
) -> tuple[list[Array], Array]:
    """Which simplices are for each capsule, and points held by none with its radius `back` less.

    Simplices that no capsule holds are halved. If every corner of one with edges up to `back` is
    held with `back` less, then the capsule that holds a corner holds it all. With `enough`, nothing
    more is halved after so many points.
    """
    a, b, r = capsules.a, capsules.b, capsules.radius
    s, q = simplices.shape[1:]
    pieces = [[np.zeros((0, s, q))] for _ in r]
    missed = [np.zeros((0, q))]
    while len(simplices):
        X = simplices.reshape(-1, q)
        over = _distances(X, a, b) - r
        missed.append(X[over.min(axis=1) > -back])
        if enough is not None and sum(map(len, missed)) > enough:
            break
        hole = (over.min(axis=1) > 0).reshape(-1, s).any(axis=1)
        over = over.reshape(-1, s, len(r)).max(axis=1)
        best = over.argmin(axis=1)
        done = over[np.arange(len(over)), best] <= 0
        longest = _longest(simplices)[0]
        # A hole is as well described by few points as by many.
        done |= (longest <= back) | (hole & (longest <= _HOLE * back))
        for k in range(len(r)):
            pieces[k].append(simplices[done & (best == k)])
        simplices = _halved(simplices[~done])
    return [np.concatenate(piece) for piece in pieces], np.concatenate(missed)


def _fitted(X: Array, body: _Body, start: _Ends | None = None) -> tuple[Array, Array, float, float]:
    """(a, b, r, p): a capsule about points, (m, q), that sticks out of a body by p.

    From a start, or from the best of several axes, the ends take steps of a fixed list as long as
    p + r / 20 decreases; steps become shorter when none helps.
    """
    starts = _axes(X) if start is None else [start]
    a, b = np.array([s[0] for s in starts]), np.array([s[1] for s in starts])

    def worth(a: Array, b: Array) -> tuple[Array, Array, Array]:
        r = _distances(X, a, b).max(axis=0)
        depth = np.minimum(body.depth(a), body.depth(b))
        # For ends outside, p is less than what sticks out.
        p = r - depth + 1e3 * np.maximum(-depth - _ROUNDING / 10, 0.0)
        return p + 0.05 * r, p, r

    value = worth(a, b)[0]
    k = int(value.argmin())
    a, b, best = a[k], b[k], float(value[k])
    q = X.shape[1]
    step = 0.25 * float(np.ptp(X, axis=0).max())
    least = 1e-3 * step
    for i in range(_STEPS):
        if step < least:
            break
        moves = step * _MOVES[q][i % len(_MOVES[q])]
        tried_a, tried_b = a + moves[:, :q], b + moves[:, q:]
        value = worth(tried_a, tried_b)[0]
        k = int(value.argmin())
        if value[k] < best:
            a, b, best = tried_a[k], tried_b[k], float(value[k])
        else:
            step *= 0.6
    _, p, r = worth(a[None], b[None])
    return a, b, float(r[0]), float(p[0])


def _axes(X: Array) -> list[_Ends]:
    """Ends of axes of points, (m, q): none, and along coordinates and principal axes."""
    q = X.shape[1]
    centre = X.mean(axis=0)
    ends = [(centre, centre)]
    for F in (np.eye(q), _principal(X)):
        Y = _dots(X, F)
        low, high = Y.min(axis=0), Y.max(axis=0)
        middle, half = (low + high) / 2, (high - low) / 2
        for k in range(q):
            across = float(np.delete(half, k).max())
            for share in (0.0, 0.5, 1.0):
                end = np.zeros(q)
                end[k] = max(0.0, half[k] - share * across)
                ends.append(((middle - end) @ F, (middle + end) @ F))
    return ends


def _moves(q: int) -> list[Array]:
    """Lists of steps of both ends, (n, 2 q): of one, of both alike or opposed, and mixed."""
    unit = np.vstack([np.eye(q), -np.eye(q)])
    none = np.zeros_like(unit)
    plain = [np.hstack(pair) for pair in ((unit, none), (none, unit), (unit, unit), (unit, -unit))]
    mixed = np.random.default_rng(0).normal(size=(7, 40, 2 * q))
    mixed /= np.linalg.norm(mixed, axis=2, keepdims=True)
    return [np.vstack([*plain, some]) for some in mixed]


_MOVES = {q: _moves(q) for q in (2, 3)}


def _candidates(body: _Body, index: int, most: float) -> _Pool:
    """Capsules with ends as near to the body's faces as `most` lets them be, by radius."""
    from scipy.optimize import linprog
    from scipy.spatial import HalfspaceIntersection, QhullError

    q = body.corners.shape[1]
    # Of a round body a hull of fewer corners: it is inside, so what sticks out is overestimated.
    few = body
    if len(body.corners) > _CORNERS:
        few = _Body.of(body.corners[_spread(body.corners, _CORNERS)])
    rows: Array = np.unique(np.round(np.column_stack([few.H, few.d]), 9), axis=0)
    H, d = rows[:, :q], rows[:, q]
    answer = linprog(
        np.append(np.zeros(q), -1.0),
        A_ub=np.column_stack([H, np.ones(len(H))]),
        b_ub=d,
        bounds=[(None, None)] * (q + 1),
    )
    best = np.asarray(answer.x, dtype=float)
    deepest, inradius = best[:q], float(best[q])
    depths = [0.0]
    if body.thick:
        depths = [] if inradius > 0.8 * most else [0.0]
        depths += [share * most for share in _DEPTHS if share * most < 0.93 * inradius]
        depths.append(0.985 * inradius)
    found = []
    for depth in depths:
        rest = d - depth
        try:
            corners = HalfspaceIntersection(np.column_stack([H, -rest]), deepest).intersections
            corners = corners[np.isfinite(corners).all(axis=1)]
            corners = corners[(_dots(corners, H) - rest).max(axis=1) <= 1e-9 + 1e-3 * most]
        except QhullError:
            corners = np.zeros((0, q))
        if len(corners) < 2:
            corners = np.vstack([deepest, deepest])
        ends = corners[_spread(corners, _ENDS)]
        i, j = np.triu_indices(len(ends))
        a, b = [ends[i]], [ends[j]]
        for F in body.frames:
            for one, other in _chords(corners, ends, H, rest, F, _APART * (depth + most)):
                a.append(one)
                b.append(other)
        A, B = np.concatenate(a), np.concatenate(b)
        # Rounding must not have moved an end outwards.
        A, B = (deepest + (1 - 1e-9) * (X - deepest) for X in (A, B))
        found.append(_Pool.within(body, index, A, B, most))
    return _Pool.joined(found)


def _chords(
    corners: Array, through: Array, H: Array, d: Array, F: Array, apart: float
) -> Iterator[tuple[Array, Array]]:
    """Ends of chords of {x : H x ≤ d} along each row of F, (k, q) each.

    On a grid over all corners, about so far apart, and through some points.
    """
    q = len(F)
    Y = _dots(corners, F)
    low, high = Y.min(axis=0), Y.max(axis=0)
    grid = [
        np.linspace(
            lo + 1e-6 * (hi - lo),
            hi - 1e-6 * (hi - lo),
            1 + int(np.clip(np.ceil((hi - lo) / apart), 2, _GRID)),
        )
        for lo, hi in zip(low, high, strict=True)
    ]
    for k in range(q):
        lines = [g if n != k else np.zeros(1) for n, g in enumerate(grid)]
        crossings = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, q)
        start: Array = _dots(np.asarray(crossings, dtype=float), F.T)
        if len(start) > _CHORDS:
            start = start[:: 1 + len(start) // _CHORDS]
        # Just inside, where rounding does not make them miss.
        start = np.vstack([start, through + 1e-6 * (corners.mean(axis=0) - through)])
        speed, room = _dots(H, F[k][None])[:, 0], d - _dots(start, H)
        forth, back = speed > 1e-9, speed < -1e-9
        if not (forth.any() and back.any()):
            continue
        hi = (room[:, forth] / speed[forth]).min(axis=1)
        lo = (room[:, back] / speed[back]).max(axis=1)
        hit = (lo <= hi) & np.all(room[:, ~(forth | back)] >= -1e-12, axis=1)
        yield start[hit] + lo[hit, None] * F[k], start[hit] + hi[hit, None] * F[k]


def _spread(X: Array, most: int) -> Indices:
    """Indices of at most so many points, (n, q), each the farthest from those before it."""
    chosen = [int(((X - X.mean(axis=0)) ** 2).sum(axis=1).argmax())]
    near = ((X - X[chosen[0]]) ** 2).sum(axis=1)
    scale = float(np.ptp(X, axis=0).max())
    while len(chosen) < most:
        k = int(near.argmax())
        if near[k] <= (1e-3 * scale) ** 2:
            break
        chosen.append(k)
        near = np.minimum(near, ((X - X[k]) ** 2).sum(axis=1))
    return np.array(chosen, dtype=np.intp)


def _samples(simplices: Array, most: float) -> Array:
    """Points of simplices, (m, s, q), about evenly apart, all around."""
    size = simplices.shape[1] - 1
    edges = simplices[:, 1:] - simplices[:, :1]
    content = np.sqrt(np.abs(np.linalg.det(edges @ edges.transpose(0, 2, 1)))).sum()
    content /= 2 if size == 2 else 6
    few, many = ((content / n) ** (1 / size) for n in (_SAMPLES, _SAMPLES_MOST))
    # Thin simplices have long edges, but hardly any content.
    longest = float(np.ptp(simplices.reshape(-1, simplices.shape[2]), axis=0).max())
    least = longest / (3 * _SAMPLES ** (1 / size))
    h = max(min(few, most), many, least)
    while True:
        coarse = _longest(simplices)[0] > 1.5 * h
        if not coarse.any():
            break
        simplices = np.concatenate([simplices[~coarse], _halved(simplices[coarse])])
    X = simplices.reshape(-1, simplices.shape[2])
    cell = np.round((X - X.min(axis=0)) / h).astype(np.intp)
    key = np.ravel_multi_index(tuple(cell.T), tuple(cell.max(axis=0) + 1))
    return np.asarray(X[np.unique(key, return_index=True)[1]])


def _longest(simplices: Array) -> tuple[Array, Indices]:
    """Length of the longest edge of each simplex, and which of the pairs of vertices it is."""
    pairs = list(itertools.combinations(range(simplices.shape[1]), 2))
    lengths = np.stack(
        [np.linalg.norm(simplices[:, i] - simplices[:, j], axis=1) for i, j in pairs], axis=1
    )
    return lengths.max(axis=1), lengths.argmax(axis=1)


def _halved(simplices: Array) -> Array:
    """Each simplex, (m, s, q), cut in two at the middle of its longest edge, (2 m, s, q)."""
    pairs = np.array(list(itertools.combinations(range(simplices.shape[1]), 2)))
    i, j = pairs[_longest(simplices)[1]].T
    rows = np.arange(len(simplices))
    middle = (simplices[rows, i] + simplices[rows, j]) / 2
    one, other = simplices.copy(), simplices.copy()
    one[rows, j] = middle
    other[rows, i] = middle
    return np.concatenate([one, other])


def _distances(X: Array, a: Array, b: Array) -> Array:
    """Distance of points, (m, q), to segments from a to b, (k, q): (m, k)."""
    e = b - a
    square = np.maximum((e * e).sum(axis=1), 1e-300)
    along = _dots(X, e) - (a * e).sum(axis=1)
    t = np.clip(along / square, 0.0, 1.0)
    far = (X * X).sum(axis=1)[:, None] - 2 * _dots(X, a) + (a * a).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(far - t * (2 * along - t * square), 0.0)))


def _parts(triangles: Array, most: float, cuts: int) -> list[Array]:
    """The triangles, (k, 3, 3), cut where that makes the convex hulls smaller, (k_i, 3, 3) each."""
    body = _Body.of(_distinct(triangles))
    X = _samples(triangles, most)
    if cuts == 0 or body.depth(X).max() <= most or _fitted(body.corners, body)[3] <= most:
        return [triangles]
    whole = _hull(body.corners)[0].volume
    best: tuple[float, Array, float] = ((1 - _GAIN) * whole, np.zeros(3), 0.0)
    for n in np.vstack([np.eye(3), _principal(X)]):
        s, t = _dots(X, n[None])[:, 0], _dots(body.corners, n[None])
        low, high = float(t.min()), float(t.max())
        # Samples are this far apart: as many beyond the plane belong to either side.
        margin = 0.04 * (high - low)
        for share in _SHARES:
            at = low + share * (high - low)
            sides = X[s <= at + margin], X[s >= at - margin]
            if min(map(len, sides)) < 10:
                continue
            volume = sum(_hull(side)[0].volume for side in sides)
            if volume < best[0]:
                best = volume, n, at
    _, n, at = best
    if not n.any():
        return [triangles]
    return [part for side in _clipped(triangles, n, at) for part in _parts(side, most, cuts - 1)]


def _clipped(triangles: Array, n: Array, at: float) -> tuple[Array, Array]:
    """What of triangles is where nᵀx ≤ at, and what where nᵀx ≥ at."""
    s = _dots(triangles, n[None])[..., 0] - at
    above = s > 0
    count = above.sum(axis=1)
    whole = [[triangles[count == 0]], [triangles[count == 3]]]
    for lone in (1, 2):
        some = count == lone
        if not some.any():
            continue
        # The vertex that is alone on its side comes first.
        first = np.argmax(above[some] == (lone == 1), axis=1)
        turn = (first[:, None] + np.arange(3)) % 3
        t = np.take_along_axis(triangles[some], turn[:, :, None], axis=1)
        u = np.take_along_axis(s[some], turn, axis=1)
        a, b, c = t[:, 0], t[:, 1], t[:, 2]
        ab = a + (u[:, 0] / (u[:, 0] - u[:, 1]))[:, None] * (b - a)
        ac = a + (u[:, 0] / (u[:, 0] - u[:, 2]))[:, None] * (c - a)
        tip, rest = (1, 0) if lone == 1 else (0, 1)
        whole[tip].append(np.stack([a, ab, ac], axis=1))
        whole[rest] += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    return np.concatenate(whole[0]), np.concatenate(whole[1])


def _distinct(simplices: Array) -> Array:
    return np.asarray(np.unique(simplices.reshape(-1, simplices.shape[-1]), axis=0))


def _dots(X: _Numbers, Y: _Numbers) -> _Numbers:
    """xᵀy of rows, (..., m, q) and (k, q): (..., m, k).

    Without BLAS: products this thin gain nothing by its threads, which wait for each other where
    cores are busy, and whose sums may differ from run to run.
    """
    products = X[..., 0, None] * Y[:, 0]
    more = np.empty_like(products)
    for i in range(1, X.shape[-1]):
        products += np.multiply(X[..., i, None], Y[:, i], out=more)
    return products


def _principal(X: Array) -> Array:
    """Principal axes of points, (m, q): orthonormal rows."""
    X = X - X.mean(axis=0)
    return np.asarray(np.linalg.eigh((X[:, :, None] * X[:, None]).sum(axis=0))[1].T)


def _outermost(X: Array) -> Array:
    """Corners of the convex hull of points, or all of them where they are flat or few."""
    from scipy.spatial import ConvexHull, QhullError

    if len(X) < 30:
        return X
    try:
        return np.asarray(X[ConvexHull(X).vertices])
    except QhullError:
        return X


def _hull(X: Array) -> tuple[ConvexHull, bool]:
    """The convex hull of points, and whether they had to be joggled for it."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(X), False
    except QhullError:
        return ConvexHull(X, qhull_options="QJ"), True


def _useful(M: Mask, chosen: Indices) -> Indices:
    """Rows that are chosen, first, and for each column some of those that have most."""
    order = np.argsort(-M.sum(axis=1), kind="stable")
    ranked = M[order]
    few = ranked & (np.cumsum(ranked, axis=0, dtype=np.int32) <= _KEPT)
    return np.concatenate([chosen, np.setdiff1d(order[few.any(axis=1)], chosen)])


def _fewest(M: Mask, start: Indices | None, exchanging: bool) -> Indices:
    """Few rows of M, (n, m), that together have every column that any row has.

    Rows are added that have most of what is missing, after a start or after each of several first
    ones, and exchanged for fewer as long as that is possible. A start that becomes longer is left
    for a new one if that is shorter. Without exchanging, rows are added to the start only.
    """
    M = M[:, M.any(axis=0)]
    B = _packed(M)
    best: list[int] = []
    if start is not None and not exchanging:
        return np.array(_completed(B, start.tolist()), dtype=np.intp)
    if start is not None:
        best = _exchanged(B, _completed(B, start.tolist()))
    if start is None or len(best) > len(start):
        able = np.flatnonzero(M[:, int(M.sum(axis=0).argmin())])
        able = able[np.argsort(-M[able].sum(axis=1), kind="stable")]
        firsts = able[:: max(1, len(able) // _STARTS)][:_STARTS].tolist()
        for first in ([], *([k] for k in firsts)):
            chosen = _exchanged(B, _completed(B, first))
            if not best or len(chosen) < len(best):
                best = chosen
    while (fewer := _two_for_three(B, best)) is not None:
        best = _exchanged(B, fewer)
    return np.array(best, dtype=np.intp)


def _packed(M: Mask) -> _Bits:
    """Rows of M, (n, m), as bits, (n, w)."""
    packed = np.packbits(M, axis=1)
    padded = np.pad(packed, ((0, 0), (0, -packed.shape[1] % 8)))
    return np.ascontiguousarray(padded).view(np.uint64)


def _counts(B: _Bits) -> Indices:
    """How many bits of each row are set, (n,)."""
    # Sums of pairs of bits, of four, of eight, and then all bytes by one multiplication; numpy
    # counts bits only from version 2.
    B = B - ((B >> np.uint64(1)) & _PAIRS)
    B = (B & _FOURS) + ((B >> np.uint64(2)) & _FOURS)
    B = (B + (B >> np.uint64(4))) & _EIGHTS
    return np.asarray(((B * _BYTES) >> np.uint64(56)).sum(axis=1), dtype=np.intp)


def _union(B: _Bits) -> _Bits:
    return np.asarray(np.bitwise_or.reduce(B, axis=0))


def _completed(B: _Bits, chosen: list[int]) -> list[int]:
    """The rows and more of them that together have every bit."""
    chosen = list(chosen)
    missing = _union(B) & ~_union(B[chosen])
    while missing.any():
        k = int(_counts(B & missing).argmax())
        chosen.append(k)
        missing &= ~B[k]
    return chosen


def _exchanged(B: _Bits, chosen: list[int]) -> list[int]:
    """Fewer rows with the same bits: none for one, one for two, while that is possible."""
    everything = _union(B[chosen])
    again = True
    while again:
        again = False
        for count in (1, 2):
            for out in itertools.combinations(chosen, count):
                rest = [k for k in chosen if k not in out]
                lost = everything & ~_union(B[rest])
                if count == 1 and lost.any():
                    continue
                instead = _with(B, lost)
                if len(instead):
                    chosen = rest + instead[: count - 1].tolist()
                    again = True
                    break
            if again:
                break
    return chosen


def _with(B: _Bits, some: _Bits) -> Indices:
    """Indices of rows that have all of some bits, (w,)."""
    able = np.arange(len(B))
    for w in np.flatnonzero(some):
        able = able[B[able, w] & some[w] == some[w]]
        if not len(able):
            break
    return able


def _two_for_three(B: _Bits, chosen: list[int]) -> list[int] | None:
    """The rows with two instead of three, tried where least is lost; None where none are found."""
    everything = _union(B[chosen])
    triples = list(itertools.combinations(chosen, 3))
    rest = [[k for k in chosen if k not in out] for out in triples]
    if not triples:
        return None
    lost = np.array([everything & ~_union(B[some]) for some in rest])
    sizes = _counts(lost)
    for t in np.argsort(sizes, kind="stable")[:_TRIPLES]:
        counts = _counts(B & lost[t])
        # One of the two has at least half.
        first = np.argsort(-counts, kind="stable")[:_PARTNERS]
        for i in first[2 * counts[first] >= sizes[t]]:
            second = _with(B, lost[t] & ~B[i])
            if len(second):
                return [*rest[t], int(i), int(second[0])]
    return None
