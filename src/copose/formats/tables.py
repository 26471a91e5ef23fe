"""Joint positions as comma-separated values, numbers in full."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from copose.formats.names import ByArm, stacked
from copose.formats.postures import ExportedPosture, knots
from copose.results import Motion


def posture_csv(exported: ExportedPosture) -> str:
    """``arm/joint, …`` and one row, rad or m."""
    names = exported.solution.joint_names
    return _text(_columns(names), [stacked(names, exported.posture.joints)])


def trajectory_csv(motion: Motion) -> str:
    """``time, arm/joint, …``: a row for every knot, s and rad or m.

    Raises:
        InputError: nothing moves.
    """
    names = motion.joint_names
    rows = ([time, *stacked(names, knot.joints)] for time, knot in knots(motion))
    return _text(["time", *_columns(names)], rows)


def _columns(names: ByArm) -> list[str]:
    return [f"{arm}/{joint}" for arm, joints in names.items() for joint in joints]


def _text(header: list[str], rows: Iterable[list[float]]) -> str:
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(repr, row) for row in rows)
    return sink.getvalue()
