"""Grasps taught from random postures: what `evaluate` closes to, and the same written out.

PYTHONPATH=src:tests python benchmarks/taught_grasps.py [POSTURES]
"""

from __future__ import annotations

import sys

import numpy as np

import copose
from made_starts import NAMES, drawn

SPACES = ("spatial", "spatial-linear", "planar", "planar-linear")


def main() -> None:
    """Print, for every robot and space, the worst gap and the worst relative difference."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for space in SPACES:
        for name in ("links",) if space.startswith("planar") else NAMES:
            rng = np.random.default_rng(0)
            gap = apart = 0.0
            for k in range(count):
                taught, written = drawn(name, space, rng, between=k % 2 == 0)
                one, two = (copose.evaluate(copose.parse(each)).after for each in (taught, written))
                assert one is not None and two is not None
                gap = max(gap, *one.closure_error.values())
                for key in ("gram", "center", "radii"):
                    a, b = (np.array(getattr(each.ellipsoid, key)) for each in (one, two))
                    apart = max(apart, float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-9)))
            print(f"{space:15} {name:12} {count} postures: gap {gap:.1e}, apart {apart:.1e}")


if __name__ == "__main__":
    main()
