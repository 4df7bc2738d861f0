"""No frame breaks a drive."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hw_bridge.dictionary import cia402
from hw_bridge.profiles import DRIVE_PROFILES
from tests.hw_bridge.bench import NODE, Bench

IDENTIFIERS = st.sampled_from(
    [
        0x000,
        0x080,
        0x77F,
        0x700 + NODE,
        0x600 + NODE,
        0x180 + NODE,
        *(base + NODE for base in range(0x200, 0x600, 0x100)),
    ]
)


@pytest.fixture(scope="module", params=DRIVE_PROFILES)
def long(request, build):
    """One bench for all examples: making a motor takes longer than they do."""
    return Bench(request.param, build)


@settings(max_examples=60, deadline=None)
@given(frames=st.lists(st.tuples(IDENTIFIERS, st.binary(max_size=8), st.booleans(), st.integers(0, 20)), max_size=25))
def test_random_frames(long, frames):
    long.nmt(129)
    long.go(110)
    long.nmt(1)
    for identifier, data, remote, wait in frames:
        long.send(identifier, b"" if remote else data, remote=remote, length=len(data) if remote else 0)
        long.go(wait)
        assert cia402.STATUS[long.drive.state].fits(long.word)
        assert abs(long.drive.axis.motor.current) <= long.drive.axis.motor.strongest * 1.000001
