"""Shared by all tests: one build folder, so that nothing is compiled twice."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def build() -> Path:
    """The project's own build folder; its cache is by content, so tests and users may share it."""
    return Path(__file__).parent.parent / "build"
