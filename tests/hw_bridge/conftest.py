"""Benches of all profiles."""

from collections.abc import Iterator

import canopen
import pytest

from hw_bridge.profiles import DRIVE_PROFILES
from tests.hw_bridge.bench import Bench


@pytest.fixture(scope="session", autouse=True)
def networks_end_soon() -> Iterator[None]:
    """Whoever disconnects waits for canopen's thread, which looks every second whether it is to end."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canopen.Network, "NOTIFIER_CYCLE", 0.05)
        yield


@pytest.fixture(scope="session", autouse=True)
def state_of_a_user(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What commands keep from one to the next is not that of whoever runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TWIN_STATE", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(params=DRIVE_PROFILES)
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


@pytest.fixture
def faulhaber(make):
    """A bench of the drive of the rig."""
    return make("faulhaber_v3")


@pytest.fixture
def epos(make):
    """A bench of the drive of another vendor."""
    return make("epos4")
