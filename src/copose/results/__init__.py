"""What is answered: postures, evidence, timings as frozen data, JSON in and out."""

from copose.results.files import read_solution, to_json, write_file
from copose.results.solution import (
    ArmRecord,
    EllipsoidRecord,
    FailureRecord,
    ObjectiveRecord,
    Optimum,
    Posture,
    ProblemRecord,
    SampleRecord,
    SearchRecord,
    Solution,
    Timing,
    VerificationRecord,
    matrix,
    place,
    vector,
)

__all__ = [
    "ArmRecord",
    "EllipsoidRecord",
    "FailureRecord",
    "ObjectiveRecord",
    "Optimum",
    "Posture",
    "ProblemRecord",
    "SampleRecord",
    "SearchRecord",
    "Solution",
    "Timing",
    "VerificationRecord",
    "matrix",
    "place",
    "read_solution",
    "to_json",
    "vector",
    "write_file",
]
