"""Following: states and parameters of a model estimated from a recording, with their uncertainty."""

from twin.follow.follower import Estimate, Follower, follow, in_band, remarks, write_run
from twin.follow.problem import FollowProblem, load

__all__ = ["Estimate", "FollowProblem", "Follower", "follow", "in_band", "load", "remarks", "write_run"]
