"""The parts that formats share: postures and knots, the problem that they answer, names, XML."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from copose.errors import InputError, nearest
from copose.loader import load
from copose.problem import Problem
from copose.results import Knot, Motion, Posture, Solution


@dataclass(frozen=True)
class ExportedPosture:
    """A posture of a result that is to be exported."""

    solution: Solution
    posture: Posture  # its ``after``, or that of a case
    # That was solved; None where it is read from the file that the result names.
    problem: Problem | None

    @classmethod
    def of(cls, solution: Solution, case: str | None, problem: Problem | None) -> ExportedPosture:
        """A result's best posture: that of a case, of the first where none is named.

        Raises:
            InputError: there is none, or no such case.
        """
        cases = {posture.name: posture for posture in solution.cases or ()}
        if case is not None and case not in cases:
            known = nearest(case, cases) if cases else "; the result has no cases"
            raise InputError(f"no case is called {case!r}{known}", key="cases")
        chosen = cases[case] if case is not None else next(iter(cases.values()), solution.after)
        if chosen is None:
            raise InputError(f"has no posture to export, it is {solution.status}{_why(solution)}")
        return cls(solution, chosen, problem)


def problem_of(result: Solution | Motion, given: Problem | None, to: str) -> Problem:
    """The problem of a result: the one given, else that of the file which the result names.

    Raises:
        InputError: it cannot be read.
    """
    file = result.problem.file
    if given is not None:
        return given
    if file is None:
        raise InputError(f"names no problem file; {to} needs the problem", key="problem.file")
    try:
        return load(file)
    except InputError as error:
        if str(error.file) != file:
            raise
        text = f"{error.message} (the result names this file; --problem names another)"
        raise InputError(text, key=error.key, file=file) from None


def knots(motion: Motion) -> Iterable[tuple[float, Knot]]:
    """The times and postures of a motion.

    Raises:
        InputError: nothing moves.
    """
    if motion.time is None or motion.knots is None:
        raise InputError(f"has no motion to export, it is {motion.status}{_why(motion)}")
    return zip(motion.time, motion.knots, strict=True)


def _why(result: Solution | Motion) -> str:
    return f": {result.reason}" if result.reason else ""


ByArm = Mapping[str, Sequence[str]]


def unique_names(names: ByArm) -> dict[str, tuple[str, ...]]:
    """Joint names by arm; a name that two arms share has the arm's name and ``_`` in front.

    Raises:
        InputError: two are still equal.
    """
    count = Counter(joint for joints in names.values() for joint in joints)
    unique = {
        arm: tuple(f"{arm}_{joint}" if count[joint] > 1 else joint for joint in joints)
        for arm, joints in names.items()
    }
    joint, times = Counter(listed(unique)).most_common(1)[0]
    if times > 1:
        raise InputError(f"two joints would be called {joint!r}; rename an arm", key="joint_names")
    return unique


def listed(names: ByArm) -> list[str]:
    """The names of all arms' joints, in file order."""
    return [joint for joints in names.values() for joint in joints]


def xml_text(root: ET.Element) -> str:
    """An XML document as indented text.

    Raises:
        InputError: a name has a character that XML cannot hold.
    """
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode") + "\n"
    try:
        ET.fromstring(text)
    except ET.ParseError:
        raise InputError("has a name with a character that XML cannot hold") from None
    return text
