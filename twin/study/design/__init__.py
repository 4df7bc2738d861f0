"""What varies from case to case: distributions with units, how they are sampled, and what that means for a case's members."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.study.design.common_prefix import CommonPrefixes, VariantInputs
from twin.study.design.distribution import Distribution
from twin.study.design.factor import Assignment, Factor, option
from twin.study.design.request import SAMPLED, StudyRequest, is_cut

if TYPE_CHECKING:
    from twin.study.design.keys import KeepKeys
    from twin.study.design.loading import load_study
    from twin.study.design.sampling import design, problem, valued
    from twin.study.design.study import Limit, Study

# the processes that run cases need none of these
__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "keys": ["KeepKeys"],
        "loading": ["load_study"],
        "sampling": ["design", "problem", "valued"],
        "study": ["Limit", "Study"],
    },
)

__all__ = [
    "SAMPLED",
    "Assignment",
    "CommonPrefixes",
    "Distribution",
    "Factor",
    "KeepKeys",
    "Limit",
    "Study",
    "StudyRequest",
    "VariantInputs",
    "design",
    "is_cut",
    "load_study",
    "option",
    "problem",
    "valued",
]
