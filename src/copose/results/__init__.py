"""Results: postures, evidence and timings as frozen data, JSON in and out."""

from copose.results.arrays import stacked
from copose.results.evidence import (
    BasinRecord,
    FailureRecord,
    Optimum,
    PlacementRecord,
    SampleRecord,
    SearchRecord,
    VerificationRecord,
)
from copose.results.files import (
    read_motion,
    read_result,
    read_solution,
    to_json,
    whole_file,
    write_file,
)
from copose.results.limits import AccelerationRecord, ExactSetRecord, WrenchRecord
from copose.results.motion import (
    Knot,
    Motion,
    PathSearchRecord,
    RouteRecord,
    TrackingRecord,
)
from copose.results.posture import (
    ArmRecord,
    CasePosture,
    CollisionRecord,
    PlanarPlace,
    Posture,
    frame,
    place,
)
from copose.results.records import CompanionRecord, EllipsoidRecord, Matrix, Vector, matrix, vector
from copose.results.solution import (
    FreeRecord,
    JointRecord,
    LinkRecord,
    ObjectiveRecord,
    ProblemRecord,
    Solution,
    Timing,
    link_records,
)

__all__ = [
    "AccelerationRecord",
    "ArmRecord",
    "BasinRecord",
    "CasePosture",
    "CollisionRecord",
    "CompanionRecord",
    "EllipsoidRecord",
    "ExactSetRecord",
    "FailureRecord",
    "FreeRecord",
    "JointRecord",
    "Knot",
    "LinkRecord",
    "Matrix",
    "Motion",
    "ObjectiveRecord",
    "Optimum",
    "PathSearchRecord",
    "PlacementRecord",
    "PlanarPlace",
    "Posture",
    "ProblemRecord",
    "RouteRecord",
    "SampleRecord",
    "SearchRecord",
    "Solution",
    "Timing",
    "TrackingRecord",
    "Vector",
    "VerificationRecord",
    "WrenchRecord",
    "frame",
    "link_records",
    "matrix",
    "place",
    "read_motion",
    "read_result",
    "read_solution",
    "stacked",
    "to_json",
    "vector",
    "whole_file",
    "write_file",
]
