"""What is answered: postures, evidence, timings as frozen data, JSON in and out."""

from copose.results.files import read_solution, to_json, write_file
from copose.results.solution import (
    ArmRecord,
    EllipsoidRecord,
    ObjectiveRecord,
    Optimum,
    Posture,
    ProblemRecord,
    SearchRecord,
    Solution,
    Timing,
    matrix,
    place,
    vector,
)

__all__ = [
    "ArmRecord",
    "EllipsoidRecord",
    "ObjectiveRecord",
    "Optimum",
    "Posture",
    "ProblemRecord",
    "SearchRecord",
    "Solution",
    "Timing",
    "matrix",
    "place",
    "read_solution",
    "to_json",
    "vector",
    "write_file",
]
