"""The FMU of a component with variables of every type."""

import pytest

import twin
from tests.face.parts import Types


@pytest.fixture(scope="module")
def fmu(tmp_path_factory, build):
    return twin.export(Types, tmp_path_factory.mktemp("fmu") / "types.fmu", build=build)
