"""FMUs that this project did not make: built with PythonFMU and PythonFMU3, or from a few lines of C."""

import subprocess
import sys
import textwrap
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.c_compilers import linking
from twin import compiler

FMI2 = """
from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Causality as C, Fmi2Variability as V, Boolean, Integer, Real, String

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.n, self.b, self.s = 0.0, 0, False, "none"
        self.k, self.label = 2.0, "start"
        self.y, self.m, self.c, self.r = 0.0, 0, False, ""
        for kind, input, output in ((Real, "u", "y"), (Integer, "n", "m"), (Boolean, "b", "c"), (String, "s", "r")):
            held = V.continuous if kind is Real else V.discrete
            self.register_variable(kind(input, causality=C.input, variability=held))
            self.register_variable(kind(output, causality=C.output, variability=held))
        self.register_variable(Real("k", causality=C.parameter, variability=V.tunable))
        self.register_variable(String("label", causality=C.parameter, variability=V.fixed))

    def do_step(self, t, h):
        self.y, self.m, self.c, self.r = self.k * self.u, self.n + 1, not self.b, self.label + self.s
        {step}
        return True
"""

FMI3 = """
import numpy as np
from pythonfmu3 import Boolean, Dimension, Enumeration, Fmi3Causality as C, Fmi3Slave, Fmi3Status, Fmi3StepResult
from pythonfmu3 import Fmi3Variability as V, Float64, Int32, Int64, String, UInt64

class {name}(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.register_variable(Float64("time", causality=C.independent, variability=V.continuous))
        self.u, self.i, self.j, self.l, self.b, self.s = 0.0, 0, 0, 0, False, "none"
        self.y, self.p, self.q, self.o, self.c, self.r = np.zeros(3), 0, 0, 0, False, ""
        self.k = 2.0
        for kind, input, output in ((Int32, "i", "p"), (Int64, "j", "q"), (UInt64, "l", "o"), (Boolean, "b", "c"),
                                    (String, "s", "r")):
            self.register_variable(kind(input, causality=C.input, variability=V.discrete))
            self.register_variable(kind(output, causality=C.output, variability=V.discrete))
        self.register_variable(Float64("u", causality=C.input, variability=V.continuous))

        # an array that nobody sets: PythonFMU3 0.3 cannot take arrays with numpy 2.4
        self.register_variable(Float64("y", causality=C.output, variability=V.continuous,
                                       dimensions=[Dimension(start="3")]))
        self.register_variable(Float64("k", causality=C.parameter, variability=V.tunable))

    def do_step(self, t, h):
        self.y = self.k * self.u * np.array([1.0, 2.0, 3.0])
        self.p, self.q, self.o, self.c, self.r = self.i + 1, self.j + 1, self.l + 1, not self.b, self.s
        {step}
        return True
"""


def python_fmu(folder: Path, template: str, name: str, step: str = "pass") -> Path:
    """An FMU whose step ends with the statement `step`. Names must differ: Python imports a module only once."""
    source = folder / f"{name.lower()}.py"
    source.write_text(template.format(name=name, step=step))
    package = "pythonfmu" if template is FMI2 else "pythonfmu3"
    arguments = [sys.executable, "-m", package, "build", "-f", str(source), "-d", str(folder)]
    subprocess.run(arguments, check=True, capture_output=True)
    return folder / f"{name}.fmu"


# n structural, x[n] parameter, y[n] output = x * t, data binary echo; ends by itself after `limit` [s]
NATIVE = r"""
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
typedef struct { uint64_t n; double x[8]; double y[8]; double limit; uint8_t data[64]; size_t length; int32_t mode;
                 void *environment; void (*log)(void *, int, const char *, const char *); } Instance;
#define VRS const uint32_t *vr, size_t nvr
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const uint32_t *required, size_t n, void *environment,
                                  void (*log)(void *, int, const char *, const char *), void *update) {
    if (strcmp(token, "native")) { log(environment, 3, "logStatusError", "wrong token"); return NULL; }
    Instance *c = calloc(1, sizeof(Instance));
    c->n = 2; c->x[0] = 1; c->x[1] = 2; c->limit = 1e9; c->environment = environment; c->log = log;
    return c;
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterConfigurationMode(void *c) { return 0; }
int fmi3ExitConfigurationMode(void *c) { return 0; }
int fmi3EnterInitializationMode(void *c, bool a, double b, double t, bool d, double e) { return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3Terminate(void *c) { return 0; }
int fmi3SetUInt64(Instance *c, VRS, const uint64_t *v, size_t nv) { c->n = v[0]; return c->n > 8 ? 3 : 0; }
int fmi3GetUInt64(Instance *c, VRS, uint64_t *v, size_t nv) { v[0] = c->n; return 0; }
int fmi3SetInt32(Instance *c, VRS, const int32_t *v, size_t nv) { c->mode = v[0]; return 0; }
int fmi3SetFloat64(Instance *c, VRS, const double *v, size_t nv) {
    for (size_t i = 0; i < nvr; i++) {
        if (vr[i] == 4) { c->limit = *v++; continue; }
        if (vr[i] != 2) return 3;
        for (size_t j = 0; j < c->n; j++) c->x[j] = *v++;
    }
    return 0;
}
int fmi3GetFloat64(Instance *c, VRS, double *v, size_t nv) {
    for (size_t i = 0; i < nvr; i++)
        for (size_t j = 0; j < c->n; j++) *v++ = vr[i] == 2 ? c->x[j] : c->y[j];
    return 0;
}
int fmi3SetBinary(Instance *c, VRS, const size_t *sizes, const uint8_t **v, size_t nv) {
    c->length = sizes[0]; memcpy(c->data, v[0], sizes[0]); return 0;
}
int fmi3GetBinary(Instance *c, VRS, size_t *sizes, const uint8_t **v, size_t nv) {
    sizes[0] = c->length; v[0] = c->data; return 0;
}
int fmi3DoStep(Instance *c, double t, double h, bool set, bool *event, bool *terminate, bool *early, double *last) {
    double end = t + h;
    *event = *terminate = *early = false;
    if (c->mode) { c->log(c->environment, c->mode, "logStatus", "mode is set"); return c->mode; }
    if (end >= c->limit) { end = c->limit; *terminate = true; }
    for (size_t j = 0; j < c->n; j++) c->y[j] = c->x[j] * end;
    *last = end;
    return 0;
}
"""

NATIVE_XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Native" instantiationToken="native">
  <CoSimulation modelIdentifier="Native" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed" start="2"/>
    <Float64 name="x" valueReference="2" causality="parameter" variability="fixed" start="1 2" unit="m">
      <Dimension valueReference="1"/>
    </Float64>
    <Float64 name="y" valueReference="3" causality="output" unit="m">
      <Dimension valueReference="1"/>
      <Alias name="y_seen" description="the same"/>
    </Float64>
    <Float64 name="limit" valueReference="4" causality="parameter" variability="fixed" start="1e9"/>
    <Binary name="data" valueReference="5" causality="input" variability="discrete"><Start value="00ff"/></Binary>
    <Binary name="echo" valueReference="6" causality="output" variability="discrete"/>
    <Int32 name="mode" valueReference="7" causality="input" start="0"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="3"/>
    <Output valueReference="6" dependencies="5"/>
  </ModelStructure>
</fmiModelDescription>
"""


@cache
def native_library(source: str) -> bytes:
    """A shared library from C."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "native.c").write_text(textwrap.dedent(source))
        command = [*linking(compiler.host()), "-shared", "-fPIC", "-O1", "-w", "-o", "Native.so", "native.c"]
        subprocess.run(command, check=True, capture_output=True, cwd=place)
        return (place / "Native.so").read_bytes()


def native_fmu(folder: Path, xml: str = NATIVE_XML, source: str = NATIVE) -> Path:
    """An FMI 3.0 FMU from C."""
    return archive(
        folder / "Native.fmu",
        {
            "modelDescription.xml": xml.encode(),
            "binaries/x86_64-linux/Native.so": native_library(source),
        },
    )


def archive(path: Path, files: dict[str, bytes]) -> Path:
    """A zip archive of some files."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, content in files.items():
            zipped.writestr(name, content)
    return path
