"""The types of FMI's functions, read one by one, are those that FMPy reads for all."""

import pytest
from fmpy.fmi1 import _FMU

from twin.fmi import binary


class Anything:
    """Takes any attribute, and has any function."""

    def __getattr__(self, name):
        if name in ("argnames", "argtypes", "restype"):
            raise AttributeError(name)
        setattr(self, name, found := Anything())
        return found


@pytest.mark.parametrize("kind", [binary.FMU2, binary.FMU3])
def test_types(kind):
    slave = object.__new__(kind)
    slave.dll, slave._functions, slave.modelIdentifier = Anything(), {}, "model"
    _FMU._loadFunctions(slave)
    assert len(slave._functions) > 30
    for name, function in slave._functions.items():
        assert binary.types(kind, name) == (function.argnames, function.argtypes, function.restype), name
