"""Shared by all tests: one build folder, so that nothing is compiled twice."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def build() -> Path:
    """The project's own build folder; its cache is by content, so tests and users may share it."""
    return Path(__file__).parent.parent / "build"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What runs on one core: the tests of a file, since its fixtures are made once; of scenarios, those of each one.

    And all with CAN over multicast: a socket hears every group that anybody on the machine has joined.
    """
    for item in items:
        if "multicast" in item.fixturenames:  # type: ignore[attr-defined]
            item.add_marker(pytest.mark.xdist_group("multicast"))
        if not list(item.iter_markers("xdist_group")):
            path = item.callspec.params.get("path") if hasattr(item, "callspec") else None
            own = path.stem if item.path.name == "test_scenarios.py" and path else item.path.as_posix()
            item.add_marker(pytest.mark.xdist_group(own))
