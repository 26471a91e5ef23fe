"""Tables of joint positions as comma-separated values, numbers in full."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from copose.formats.postures import ExportedPosture, knots
from copose.results import Motion


def posture_csv(exported: ExportedPosture) -> str:
    """The table of a posture, ``arm/joint, …`` and one row, rad or m."""
    return _text([*exported.solution.q_names], [exported.posture.q.tolist()])


def trajectory_csv(motion: Motion) -> str:
    """The table of a motion, ``time, arm/joint, …``: a row for every knot, s and rad or m.

    Raises:
        InputError: nothing moves.
    """
    rows = ([time, *knot.q.tolist()] for time, knot in knots(motion))
    return _text(["time", *motion.q_names], rows)


def _text(header: list[str], rows: Iterable[list[float]]) -> str:
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(repr, row) for row in rows)
    return sink.getvalue()
