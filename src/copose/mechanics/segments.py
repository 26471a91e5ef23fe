"""The distance of two segments, as an expression."""

from __future__ import annotations

import casadi as ca

# Keeps parallel segments, and segments that are points, from dividing by zero.
_PARALLEL, _TINY = 1e-12, 1e-30


def squared_distance(a0: ca.SX, a1: ca.SX, b0: ca.SX, b1: ca.SX) -> ca.SX:
    """Min over s, t in [0, 1] of ‖a0 + s (a1 − a0) − b0 − t (b1 − b0)‖², of ends (3,).

    The lines' own nearest point on a, then the nearest on b to that, then on a to that: the square
    is convex in (s, t), so that the third step undoes what clipping spoils (C. Ericson, *Real-Time
    Collision Detection*, 2005, section 5.1.9). Where the nearest points are unique it has a
    continuous derivative.
    """
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv, uw, vw = (ca.dot(x, y) for x, y in ((u, u), (v, v), (u, v), (u, w), (v, w)))
    across = uu * vv - uv * uv + _PARALLEL * uu * vv + _TINY
    s = _clipped((uv * vw - vv * uw) / across)
    t = _clipped((uv * s + vw) / (vv + _TINY))
    s = _clipped((uv * t - uw) / (uu + _TINY))
    between = w + s * u - t * v
    squared: ca.SX = ca.dot(between, between)
    return squared


def _clipped(x: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(x, 0), 1)
