"""Optima that come as near to what is in their way as bodies allow.

Capsules stick out. Where those that stop an optimum are less near than the bodies in them, they may
come nearer by that much; and stay farther apart, where it turns out to come too near.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from copose.planning.machinery import Machinery, Setting
from copose.planning.optima import LocalOptimum
from copose.planning.search import Found

# Optima that come first, as far as that, relative, below the best; and runs for each of them, and
# for what is then the best.
_CANDIDATES, _BELOW = 4, 1e-2
_FEW_RUNS, _RUNS = 3, 8
# A relative gain that is none, and how far a run goes at first, rad or m.
_NO_GAIN, _ROOM = 1e-6, 0.1


def tightened(machinery: Machinery, setting: Setting, found: Found) -> Found:
    """A search whose best optimum touches what is in its way."""
    if setting.clearance is None or not found.optima:
        return found
    best = found.optima[0].objective
    least = best - _BELOW * max(1.0, abs(best))
    first = [o for o in found.optima[:_CANDIDATES] if o.objective >= least]
    rest = found.optima[len(first) :]
    some = first
    if len(first) > 1:
        some = _sorted([_brought_up(machinery, setting, each, _FEW_RUNS) for each in first])
    if some:
        some = _sorted([_brought_up(machinery, setting, some[0], _RUNS), *some[1:]])
    return replace(found, optima=(*some, *rest))


def _sorted(optima: list[LocalOptimum | None]) -> list[LocalOptimum]:
    return sorted((o for o in optima if o is not None), key=lambda o: -o.objective)


def _brought_up(
    machinery: Machinery, setting: Setting, start: LocalOptimum, runs: int
) -> LocalOptimum | None:
    """What some runs of IPOPT from an optimum come to; None where bodies are always too near."""
    best, room, trial = None, _ROOM, start
    for _ in range(runs):
        gain = np.inf if best is None else trial.objective - best.objective
        if gain > 0 and machinery.exactly(setting, trial.q):
            best = trial
            if gain <= _NO_GAIN * max(1.0, abs(trial.objective)):
                break
        elif best is not None:
            # Near a posture its calibration holds.
            room /= 4
        here = trial.q if best is None else best.q
        end = machinery.solve_near(setting, here, room)
        value = machinery.objectives(setting, end.q[None])[0] if end.converged else -np.inf
        trial = LocalOptimum(end.q, float(value), start.count)
    return best
