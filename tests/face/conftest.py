"""A scenario, its run and the FMU of its component, for the tests of the Python face."""

import pytest

import twin
from tests.face.parts import SCENARIO, Types


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("face")
    (folder / "pushed.yaml").write_text(SCENARIO)
    return folder


@pytest.fixture(scope="module")
def scenario(place):
    return twin.load(place / "pushed.yaml")


@pytest.fixture(scope="module")
def run(scenario, place, build):
    return scenario.run(out=place / "runs", build=build, backend="compiled")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory, build):
    return twin.export(Types, tmp_path_factory.mktemp("fmu") / "types.fmu", build=build)
