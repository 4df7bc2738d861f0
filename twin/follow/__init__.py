"""Following: states and parameters of a model estimated from a recording or a running rig, with their uncertainty."""

from twin.follow.estimate_recording import EstimateRecording
from twin.follow.follower import Estimate, follow, in_band, remarks, summary_of, write_run
from twin.follow.live import LiveFollowing
from twin.follow.live_problem import LiveProblem, has_rig, load_live
from twin.follow.problem import FollowProblem, load

__all__ = [
    "Estimate",
    "EstimateRecording",
    "FollowProblem",
    "LiveFollowing",
    "LiveProblem",
    "follow",
    "has_rig",
    "in_band",
    "load",
    "load_live",
    "remarks",
    "summary_of",
    "write_run",
]
