"""Benches of all profiles."""

import pytest

from hw_bridge.profiles import MODULES
from tests.hw_bridge.bench import Bench


@pytest.fixture(params=MODULES)
def name(request):
    return request.param


@pytest.fixture
def make(build):
    """Make a bench of a profile."""
    return lambda profile, **more: Bench(profile, build, **more)


@pytest.fixture
def bench(make, name):
    """A bench of each profile."""
    return make(name)
