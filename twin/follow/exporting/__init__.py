"""Export of a follow file: its unscented filter and the model inside as one component, which becomes an FMU or C."""

from twin.follow.exporting.estimator import Estimator, estimator, is_follow_file

__all__ = ["Estimator", "estimator", "is_follow_file"]
