"""What a run calls, and what it reads of a description, is what FMPy calls and reads."""

import ctypes
import inspect
from pathlib import Path
from types import UnionType
from typing import get_args

import pytest
from fmpy import fmi2, fmi3, read_model_description

from tests.every_case import every_case
from tests.fmi.third_party import FMI2, native_fmu, python_fmu
from twin.component import catalog
from twin.fmi import fmi_version
from twin.fmi.archive import unpack
from twin.fmi.exporting import fmu_cache
from twin.fmi.importing.c_functions import FUNCTIONS, MAKERS

SLAVES = {"fmi2": (fmi2.FMU2Slave, fmi2.FMU2Model), "fmi3": (fmi3.FMU3Slave,)}
INSTANCE = 1


def told(kind):
    """A type of an argument so that two of the same meaning are equal: what it points to, what a callback takes."""
    if isinstance(kind, UnionType):
        return told(get_args(kind)[0])
    if hasattr(kind, "_argtypes_"):
        return "callback", kind._restype_, *map(told, kind._argtypes_)
    if issubclass(kind, ctypes.Structure):
        return [(name, told(one)) for name, one in kind._fields_]
    if hasattr(kind, "contents"):
        return "pointer", told(kind._type_)
    return kind


@every_case("name", [*FUNCTIONS, *MAKERS])
def test_arguments(name):
    method = next(getattr(slave, name) for slave in SLAVES[name[:4]] if hasattr(slave, name))
    theirs = [told(one.annotation) for one in list(inspect.signature(method).parameters.values())[1:]]
    ours = [told(one) for one in (FUNCTIONS | MAKERS)[name]]
    assert theirs[len(theirs) - len(ours) :] == ours
    assert len(theirs) == len(ours) + (name in FUNCTIONS) * INSTANCE


def same(path: Path) -> None:
    """Everything that is read of an FMU is what FMPy reads."""
    with unpack(path) as unpacked:
        ours = unpacked.description
    theirs = read_model_description(str(path), validate=False)
    interface = theirs.coSimulation
    assert (ours.token, ours.identifier) == (theirs.guid, interface.modelIdentifier)
    assert ours.generator == (theirs.generationTool or "")
    for name, value in ours.capabilities.items():
        if hasattr(interface, fmi_version.FMI2.capability_names.get(name, name)):
            assert value == getattr(interface, fmi_version.FMI2.capability_names.get(name, name)), name
    for name in ("startTime", "stopTime", "tolerance", "stepSize"):
        assert ours.experiment.get(name) == getattr(theirs.defaultExperiment, name, None)
    assert ours.fixed_step == interface.fixedInternalStepSize
    assert [one.name for one in ours.variables] == [one.name for one in theirs.modelVariables]
    for one, other in zip(ours.variables, theirs.modelVariables, strict=True):
        common = other.declaredType

        def of(key, own=other, shared=common):
            return getattr(own, key) or getattr(shared, key, None)

        assert (one.reference, one.type, one.causality, one.variability) == (
            other.valueReference,
            other.type,
            other.causality,
            other.variability,
        )
        assert (one.initial, one.start, one.minimum) == (other.initial or "", other.start, of("min"))
        assert (one.maximum, one.unit, one.display_unit) == (of("max"), of("unit") or "", of("displayUnit") or "")
        assert one.description == (of("description") or "")
        assert tuple(size.start for size in one.dimensions) == other.shape
        assert [name for name, _ in one.items] == [item.name for item in getattr(common, "items", [])]
    unknowns = {one.variable.name: one.dependencies for one in (*theirs.outputs, *theirs.initialUnknowns)}
    assert ours.dependencies == {
        name: None if known is None else tuple(one.name for one in known if one.causality == "input")
        for name, known in unknowns.items()
    }
    for unit, other in zip(ours.units, theirs.unitDefinitions, strict=True):
        base = other.baseUnit
        assert (unit.size is None) == (base is None)
        if base is not None:
            assert unit.size.factor == base.factor
            powers = base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad
            assert unit.size.exponents == powers
        assert [name for name, *_ in unit.displays] == [one.name for one in other.displayUnits]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", ["servomotor", "instrument", "pi_control", "injection_sequence"])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_description_of_components(name, version, build):
    same(fmu_cache.build(catalog.component(name), version, build))


@pytest.mark.slow
def test_description_of_others(tmp_path):
    same(native_fmu(tmp_path))
    same(python_fmu(tmp_path, FMI2, "Gain"))
