"""Every component of fmus/ passes every check; a new folder is tested without another line."""

import pytest

from twin.component import catalog
from twin.conformance import agreement as conformance

CASES = [(name, check) for name in catalog.names() for check in conformance.checks(catalog.component(name))]


@pytest.mark.parametrize(("name", "check"), CASES)
def test_component(name, check, build):
    conformance.CHECKS[check](catalog.component(name), build)
