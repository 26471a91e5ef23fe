"""What is answered: postures, evidence, timings as frozen data, JSON in and out."""

from copose.results.files import read_solution, to_json, write_file
from copose.results.limits import AccelerationRecord, ExactSetRecord, WrenchRecord
from copose.results.records import CompanionRecord, EllipsoidRecord, matrix, vector
from copose.results.solution import (
    ArmRecord,
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
    place,
)

__all__ = [
    "AccelerationRecord",
    "ArmRecord",
    "CompanionRecord",
    "EllipsoidRecord",
    "ExactSetRecord",
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
    "WrenchRecord",
    "matrix",
    "place",
    "read_solution",
    "to_json",
    "vector",
    "write_file",
]
