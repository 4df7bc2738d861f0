"""Every component of fmus/ passes every check; a new folder is tested without another line.

Both versions of FMI wrap the same translated C. As FMI 3.0 all components are tested at once; as FMI 2.0, where arrays
become scalars and integers have other types, those that together have every kind of variable, the others as slow tests.
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
CASES = [
    pytest.param(name, check, marks=[pytest.mark.slow] * (check == "interpreted" and name in INTERPRETED_FOR_SECONDS))
    for name in catalog.names()
    for check in conformance.checks(catalog.component(name))
]
NATIVE = [name for name in catalog.names() if not issubclass(catalog.component(name), PythonComponent)]
FMI_2 = (
    "heart_motion",
    "fiber",
    "omnidirectional_feedforward",
    "operator_command",
    "regripping_sequencer",
    "self_calibration",
)


@pytest.mark.parametrize(("name", "check"), CASES)
def test_component(name, check, build, monkeypatch):
    monkeypatch.setattr(conformance, "VERSIONS", ("3.0",))
    conformance.CHECKS[check](catalog.component(name), build)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", some(NATIVE, FMI_2))
def test_component_as_fmi_2(name, build, monkeypatch):
    monkeypatch.setattr(conformance, "VERSIONS", ("2.0",))
    conformance.check_fmu(catalog.component(name), build)


def test_the_components_chosen_for_fmi_2_have_every_kind_of_variable():
    def kinds(names):
        """Type, number of dimensions and role of each variable."""
        roles = (Role.input, Role.output, Role.parameter)
        variables = (variable for name in names for variable in catalog.component(name).variables)
        return {(one.type, len(one.shape), one.role) for one in variables if one.role in roles}

    assert kinds(NATIVE) - kinds(FMI_2) == set()
