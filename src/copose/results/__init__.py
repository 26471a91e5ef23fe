"""What is answered: postures, evidence, timings as frozen data, JSON in and out."""

from copose.results.files import read_solution, to_json, write_file
from copose.results.limits import AccelerationRecord, ExactSetRecord, WrenchRecord
from copose.results.records import CompanionRecord, EllipsoidRecord, matrix, vector
from copose.results.solution import (
    ArmRecord,
    CasePosture,
    CollisionRecord,
    FailureRecord,
    FreeRecord,
    ObjectiveRecord,
    Optimum,
    PlacementRecord,
    Posture,
    ProblemRecord,
    SampleRecord,
    SearchRecord,
    Solution,
    Timing,
    VerificationRecord,
    frame,
    place,
)

__all__ = [
    "AccelerationRecord",
    "ArmRecord",
    "CasePosture",
    "CollisionRecord",
    "CompanionRecord",
    "EllipsoidRecord",
    "ExactSetRecord",
    "FailureRecord",
    "FreeRecord",
    "ObjectiveRecord",
    "Optimum",
    "PlacementRecord",
    "Posture",
    "ProblemRecord",
    "SampleRecord",
    "SearchRecord",
    "Solution",
    "Timing",
    "VerificationRecord",
    "WrenchRecord",
    "frame",
    "matrix",
    "place",
    "read_solution",
    "to_json",
    "vector",
    "write_file",
]
