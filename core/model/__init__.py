"""What travels along the road: one frozen dataclass for every arrow between two stages.

    capture -> Capture -> decode -> PhaseMap -> measure -> TargetSet -> calibrate -> Photogrammetric / DepthCalibration
    -> reconstruct -> PointCloud -> evaluate -> PlaneEvaluation -> report

Units are in the names; lengths are mm, device pixel coordinates px (camera) or lines (projector). The frames are those
of `core.geometry`. Nothing here computes more than a property.
"""

from core.model.arrays import Array, Figures, Floats, Ints
from core.model.beside import (
    DriftPoint,
    Feature,
    KnownLength,
    KnownPoints,
    Overlap,
    Registration,
    RigCorrection,
    RigMotion,
)
from core.model.calibration import (
    AdjustedDevice,
    Adjustment,
    Calibration,
    DepthCalibration,
    Method,
    Orientation,
    Pair,
    PhotogrammetricCalibration,
)
from core.model.capture import Capture, Frame, Plan, Role, Subject
from core.model.finding import (
    UNJUDGED,
    Concern,
    Finding,
    LeftOut,
    Names,
    Note,
    Verdict,
    bluntness,
    named_by,
    points_at_a_cause,
    verdict_of,
)
from core.model.maps import PhaseMap, PlaneEvaluation, PointCloud
from core.model.network import Network, NetworkDevice, NetworkScale, StationId, TargetId
from core.model.rig import DeviceSpec, Interior, Project, Rig, ScaleBar
from core.model.targets import MissingTarget, Seed, TargetSet, Testfield

__all__ = [
    "UNJUDGED",
    "AdjustedDevice", "Adjustment", "Array", "Calibration", "Capture", "Concern", "DepthCalibration", "DeviceSpec",
    "DriftPoint", "Feature", "Figures", "Finding", "Floats", "Frame", "Interior", "Ints", "KnownLength", "KnownPoints",
    "LeftOut", "Method", "MissingTarget", "Names", "Network", "NetworkDevice", "NetworkScale", "Note", "Orientation",
    "Overlap", "Pair", "PhaseMap", "PhotogrammetricCalibration", "Plan", "PlaneEvaluation", "PointCloud",
    "Project", "Registration", "Rig", "RigCorrection", "RigMotion", "Role", "ScaleBar", "Seed", "StationId", "Subject",
    "TargetId", "TargetSet", "Testfield", "Verdict", "bluntness", "named_by", "points_at_a_cause", "verdict_of",
]  # fmt: skip
