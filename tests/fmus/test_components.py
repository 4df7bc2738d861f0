"""What holds for every component of the force experiment."""

from pathlib import Path

import numpy as np
import pytest

import fmus
from tests.every_case import every_case
from twin.component import Float64, Role, catalog, source, unit
from twin.conformance import reference


def folder(name):
    return next(Path(place) / name for place in fmus.__path__ if (Path(place) / name).is_dir())


NAMES = (
    "bouc_wen_compensator",
    "chirp",
    "em_tracker",
    "force_sensor",
    "heart",
    "heart_estimate",
    "pi_bouc_wen_control",
    "pi_control",
    "pi_feedforward_control",
    "prandtl_ishlinskii_compensator",
    "rate_bouc_wen_compensator",
    "regripping_sequencer",
    "servomotor",
    "sheath",
    "travel_command",
    "wall",
)


@every_case("name", NAMES)
def test_source_is_fit_for_compilation(name):
    assert source.check(catalog.component(name)) == []


@pytest.mark.parametrize("name", NAMES)
def test_expected_is_reproduced_to_the_bit(name, native):
    cls = catalog.component(name)
    expected = reference.read(folder(name) / "expected.csv", cls)
    assert reference.differences(expected, reference.replay(cls, expected)) == {}
    assert reference.differences(expected, reference.replay(reference.InstanceTarget(native(cls)), expected)) == {}


@every_case("name", NAMES)
def test_expected_exercises_every_output(name):
    cls = catalog.component(name)
    expected = reference.read(folder(name) / "expected.csv", cls)
    types = {element: variable.type for variable in cls.variables for element in variable.elements()}
    for column, output in enumerate(expected.outputs, 1 + len(expected.inputs)):
        if types[output] is Float64:  # the others have few values, which the component's own tests reach
            assert len({row[column] for row in expected.rows}) > 3, output


@every_case("name", NAMES)
def test_units_exist_and_every_parameter_has_a_source(name):
    text = (folder(name) / "README.md").read_text()
    for variable in catalog.component(name).variables:
        unit.conversion(variable.unit, variable.display_unit, variable.name)
        unit.describe(variable.unit)
        if variable.role is Role.parameter:
            assert variable.source, variable.name
            assert f"| {variable.name} | " in text


@every_case("name", NAMES)
def test_initialization_can_be_repeated(name):
    instance = catalog.component(name)()
    instance.start(0.0)
    first = instance.record.copy()
    instance.advance(0.0, 0.025)
    instance.start(0.0)

    # a latency line and the scratch of a solver may keep what nobody reads before it is written
    for variable in instance.variables:
        if variable.role is Role.output:
            np.testing.assert_array_equal(instance.record[variable.name], first[variable.name], variable.name)
