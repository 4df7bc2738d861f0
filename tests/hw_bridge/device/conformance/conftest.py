"""The profiles whose conformance is checked: those for which the checks have units and ranges. Not the EPOS2 yet."""

import pytest

from hw_bridge.profiles import MODULES


@pytest.fixture(params=[name for name in MODULES if name != "epos2"])
def name(request):
    return request.param
