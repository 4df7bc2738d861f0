"""Which vendors' profiles a test runs on in the fast suite: the one with most objects, and those that differ."""

from hw_bridge.profiles import DRIVE_PROFILES
from tests.matrix import some

USUAL = "faulhaber_v3"


def fast(*values, of=tuple(DRIVE_PROFILES)):
    """Parameters of a test, profiles if no others are given; those that are not among `values` are slow."""
    return some(of, values)
