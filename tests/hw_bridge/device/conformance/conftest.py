"""The profiles whose conformance is checked. A rule is fast on one of them, and on others where `motions.on` names them."""

import pytest

from tests.hw_bridge.device.conformance.motions import PROFILES
from tests.hw_bridge.profiles import USUAL, fast


@pytest.fixture(params=fast(USUAL, of=PROFILES))
def name(request):
    return request.param
