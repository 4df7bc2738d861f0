"""Following: states and parameters of a model estimated from a recording, with their uncertainty."""

from twin.follow.follower import Estimate, follow, in_band, remarks, write_run
from twin.follow.problem import FollowProblem, load

__all__ = ["Estimate", "FollowProblem", "follow", "in_band", "load", "remarks", "write_run"]
