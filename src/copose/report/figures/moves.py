"""Which joints a result moves most."""

from __future__ import annotations

from copose.report.style import short
from copose.results import Solution

# Joints that are named at most, and the least move worth naming, rad or m.
_NAMED = 4
_LEAST = 0.01


def moved_words(solution: Solution) -> str:
    """The joints that differ most between before and after, and by how much, rad or m.

    Empty where there are not both, or nothing moves.
    """
    before, after = solution.before, solution.after
    if before is None or after is None:
        return ""
    moves = [
        (new - old, f"{short(arm)} {short(name, 30)}")
        for arm, names in solution.joint_names.items()
        for name, old, new in zip(names, before.joints[arm], after.joints[arm], strict=True)
    ]
    most = sorted(moves, key=lambda move: -abs(move[0]))[:_NAMED]
    named = [f"{name} {move:+.2f}" for move, name in most if abs(move) >= _LEAST]
    return f"moved most, rad or m: {', '.join(named)}" if named else ""
