"""Every component of fmus/ passes every check; a new folder is tested without another line.

Compiled, as an FMU and as a folder of C those are tested at once that together have every kind of variable, the others as
slow tests.
"""

import pytest

from tests.matrix import some
from twin.component import PythonComponent, Role, catalog
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


def is_slow(name, check):
    """An interpreted component may compute for seconds; the other forms are to be built."""
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
