"""Following: states and parameters of a model estimated from a recording or a running rig, with their uncertainty."""

from __future__ import annotations

from twin.callable_package import make_callable
from twin.follow.changes import Alarm
from twin.follow.estimate_recording import EstimateRecording, write_run
from twin.follow.exporting import estimator, is_follow_file
from twin.follow.follower import Estimate, Follower, follow, in_band, remarks, summary_of
from twin.follow.live import Following, LiveFollowing
from twin.follow.live_problem import LiveProblem, has_rig, load_live
from twin.follow.problem import FollowProblem, load
from twin.follow.publishing import Publisher
from twin.follow.records import path_of
from twin.follow.status import LOST, STATUS_FILE, FollowStatus

__all__ = [
    "LOST",
    "STATUS_FILE",
    "Alarm",
    "Estimate",
    "EstimateRecording",
    "FollowProblem",
    "FollowStatus",
    "Follower",
    "Following",
    "LiveFollowing",
    "LiveProblem",
    "Publisher",
    "estimator",
    "follow",
    "has_rig",
    "in_band",
    "is_follow_file",
    "load",
    "load_live",
    "path_of",
    "remarks",
    "summary_of",
    "write_run",
]


make_callable(__name__)
