"""An FMU loaded with FMPy, spoken to in the component's own names."""

import ctypes
from copy import copy
from functools import cache

import numpy as np
from elftools.elf.elffile import ELFFile
from fmpy import fmi2, fmi3, read_model_description

VERSIONS = ("2.0", "3.0")
SLAVES = {
    ("2.0", "CS"): fmi2.FMU2Slave,
    ("3.0", "CS"): fmi3.FMU3Slave,
    ("2.0", "ME"): fmi2.FMU2Model,
    ("3.0", "ME"): fmi3.FMU3Model,
}
TYPES_2 = {"Float64": "Real", "Int32": "Integer", "Int64": "Integer", "Boolean": "Boolean"}


@cache
def described(path):
    """FMPy's description of an FMU, checked against the schema once: tests make instances by the hundred."""
    return read_model_description(str(path))


@cache
def opened(slave, identifier, folder, guid):
    """FMPy's FMU without an instance: to look up its functions takes longer than what most tests do with them."""
    return slave(guid=guid, modelIdentifier=identifier, unzipDirectory=folder, instanceName="it")


class Fmu:
    """A loaded FMU whose variables are read and written by the component's names, arrays whole."""

    def __init__(self, fmus, part, version, token=None, logging=False, kind="CS", **options):
        path, self.folder = fmus[part, version]
        self.version, self.part, self.kind, self.log = version, part, kind, []
        description = described(path)
        identifier = description.coSimulation.modelIdentifier
        known = opened(SLAVES[version, kind], identifier, str(self.folder), token or description.guid)
        self.slave = copy(known)
        self.slave.dll = ctypes.CDLL(known.dll._name)  # FMPy closes it with the instance
        getattr(self, f"_instantiate_{version[0]}")(logging, **options)
        self.references = {own_name(v.name): v.valueReference for v in description.modelVariables}

    def _instantiate_2(self, logging):
        callbacks = fmi2.fmi2CallbackFunctions()
        self.logger = fmi2.fmi2CallbackLoggerTYPE(lambda _, name, *line: self.log.append(line))
        callbacks.logger = self.logger
        self.callbacks = callbacks
        self.slave.instantiate(callbacks=callbacks, loggingOn=logging)

    def _instantiate_3(self, logging, **options):
        self.slave.instantiate(logMessage=lambda _, *line: self.log.append(line), loggingOn=logging, **options)

    def access(self, name, verb):
        variable = next(v for v in self.part.variables if v.name == name)
        names = [name] if self.version == "3.0" else variable.elements()
        kind = (TYPES_2 if self.version == "2.0" else {}).get(variable.type, variable.type)
        return variable, [self.references[n] for n in names], getattr(self.slave, f"{verb}{kind}")

    def get(self, name):
        variable, references, getter = self.access(name, "get")
        values = getter(references, variable.size) if self.version == "3.0" else getter(references)
        return np.array(values, variable.dtype)

    def set(self, name, value):
        _, references, setter = self.access(name, "set")
        setter(references, np.atleast_1d(value).tolist())

    def enter(self, t=0.0, stop=None):
        if self.version == "2.0":
            self.slave.setupExperiment(startTime=t, stopTime=stop)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=t, stopTime=stop)

    def begin(self, t=0.0, stop=None):
        self.enter(t, stop)
        self.slave.exitInitializationMode()
        return self

    def step(self, t, h):
        self.slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def outputs(self):
        return b"".join(self.get(v.name).tobytes() for v in self.part.variables if v.role == "output")


def function(fmu, name):
    """A function of the library by its name without `fmi3`, to be called with any arguments; returns a status."""
    found = fmu.slave.dll[f"fmi{fmu.version[0]}{name}"]  # a new function object: FMPy's argument types stay FMPy's
    found.restype = ctypes.c_int
    return found


def own_name(name):
    """The component's name of a variable: `der_x` for `der(x)`."""
    return f"der_{name[4:-1]}" if name.startswith("der(") else name


def reference_outputs(component):
    return b"".join(component.views[v.name].tobytes() for v in component.variables if v.role == "output")


def symbols(library):
    """(defined, needed) dynamic symbols of a Linux library, as `nm -D` lists them."""
    with library.open("rb") as file:
        table = ELFFile(file).get_section_by_name(".dynsym")
        named = [(symbol.name, symbol["st_shndx"] == "SHN_UNDEF") for symbol in table.iter_symbols() if symbol.name]
    return {name for name, is_needed in named if not is_needed}, {name for name, is_needed in named if is_needed}
