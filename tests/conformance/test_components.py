"""Every component of fmus/ passes every check; a new folder is tested without another line.

Compiled, as an FMU and as a folder of C those are tested at once that together have every kind of variable, the others as
slow tests.
"""

import inspect
import re
from pathlib import Path

import pytest
import yaml

from tests.matrix import some
from twin.component import PythonComponent, Role, catalog
from twin.component.unit import conversion
from twin.conformance import agreement as conformance

INTERPRETED_FOR_SECONDS = (
    "adaptive_harmonic_control",
    "heart_motion",
    "instrument",
    "lqg_control",
    "repetitive_control",
    "stepper_axis",
    "tendon_segments",
    "tip_contact",
)
EVERY_KIND = (
    "heart_motion",
    "fiber",
    "omnidirectional_feedforward",
    "operator_command",
    "regripping_sequencer",
    "self_calibration",
)

# a row of a README's table of sources: parameter, number, unit, source
STATED = re.compile(r"^\| (\w+) \| (-?\d[\d.]*(?:e-?\d+)?)(?: ([^ |,]+))? \|[^|]*\|$", re.MULTILINE)


def is_slow(name, check):
    """An interpreted component may compute for seconds; the other forms are to be built. Documentation is read at once."""
    if check == "documentation":
        return False
    return name in INTERPRETED_FOR_SECONDS if check == "interpreted" else name not in EVERY_KIND


CASES = [
    pytest.param(name, check, marks=[pytest.mark.slow] * is_slow(name, check))
    for name in catalog.names()
    for check in conformance.checks(catalog.component(name))
]
NATIVE = [name for name in catalog.names() if not issubclass(catalog.component(name), PythonComponent)]


@pytest.mark.parametrize(("name", "check"), CASES)
def test_component(name, check, build, monkeypatch):
    monkeypatch.setattr(conformance, "VERSIONS", ("3.0",))
    conformance.CHECKS[check](catalog.component(name), build)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", some(NATIVE, EVERY_KIND))
def test_component_as_fmi_2(name, build, monkeypatch):
    monkeypatch.setattr(conformance, "VERSIONS", ("2.0",))
    conformance.check_fmu(catalog.component(name), build)


def test_chosen_components_have_every_kind_of_variable():
    def kinds(names):
        """Type, number of dimensions and role of each variable."""
        roles = (Role.input, Role.output, Role.parameter)
        variables = (variable for name in names for variable in catalog.component(name).variables)
        return {(one.type, len(one.shape), one.role) for one in variables if one.role in roles}

    assert kinds(NATIVE) - kinds(EVERY_KIND) == set()


@pytest.mark.parametrize("name", catalog.names())
def test_readme_states_the_declared_values(name):
    component = catalog.component(name)
    readme = Path(inspect.getfile(component)).with_name("README.md").read_text()
    declared = {variable.name: variable for variable in component.variables if variable.shape == ()}
    for parameter, number, unit in STATED.findall(readme):
        factor, offset = conversion(unit, declared[parameter].unit, parameter)
        assert float(number) * factor + offset == pytest.approx(declared[parameter].start, rel=0.005), parameter


@pytest.mark.parametrize("name", catalog.names())
def test_a_value_taken_from_another_component_is_that_value(name):
    """A source "as COMPONENT", also with a reason after a colon, promises the value of that component's parameter."""
    for variable in catalog.component(name).variables:
        other = re.fullmatch(r"as (\w+)(?::.*)?", variable.source or "")
        if variable.role is Role.parameter and variable.shape == () and other and other[1] in catalog.names():
            values = {one.name: one.start for one in catalog.component(other[1]).variables}
            assert variable.start == values.get(variable.name, variable.start), variable.name


@pytest.mark.parametrize("name", ["braided_sleeve", "instrument"])
def test_readme_states_the_guidewire(name):
    """The third column: the value of `scenarios/instruments/guidewire.yaml`, or "same" where that has none."""
    readme = Path(inspect.getfile(catalog.component(name))).with_name("README.md").read_text()
    given = yaml.safe_load(Path("scenarios/instruments/guidewire.yaml").read_text())[name]
    rows = re.findall(r"^\| (\w+) \| [^|]+ \| ([^|]+) \| [^|]+\|$", readme, re.MULTILINE)
    same = {parameter for parameter, wire in rows if wire in ("same", "other")}
    assert {parameter for parameter, _ in rows[1:]} - same == set(given)
