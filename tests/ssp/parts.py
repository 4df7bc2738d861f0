"""Small components and SSPs for the tests: a wave, a gain in other units, texts of descriptions."""

import zipfile
from pathlib import Path

from twin.component import Component, input, local, output, parameter
from twin.fmi.exporting import exporter

HEAD = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
    'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
    'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
    'xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"'
)
UNITS = """<ssd:Units>
<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
<ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
</ssd:Units>"""


class Ramp(Component):
    """A position that grows."""

    y = output("mm", "position")
    speed = parameter(3.0, "mm/s", "speed", source="assumed")
    offset = parameter(0.0, "mm", "position at the start", source="assumed")

    def initialize(self):
        self.y = self.offset

    def step(self, t, h):
        self.y = self.offset + self.speed * (t + h)


class Spring(Component):
    """A force in proportion, of what came in; `bias` is an input that may stay unconnected."""

    u = input("m", "position")
    bias = input("N", "more force")
    f = output("N", "force")
    stiffness = parameter(100.0, "N/m", "stiffness", source="assumed")

    def initialize(self):
        self.f = self.stiffness * self.u + self.bias

    def step(self, t, h):
        self.f = self.stiffness * self.u + self.bias


class Memory(Component):
    """The mean of what came in, told by a local variable; samples every 2 ms."""

    period = 2e-3

    u = input("", "in")
    mean = local(0.0, "", "mean of all that came in")
    last = local((0.0, 0.0), "", "the last two")
    count = local(0.0, "", "how many")

    def step(self, t, h):
        self.count += 1.0
        self.mean += (self.u - self.mean) / self.count
        self.last[0] = self.last[1]
        self.last[1] = self.u


class Bare(Component):
    """A gain whose variables have no units."""

    u = input("", "in")
    y = output("", "out")
    k = parameter(1.0, "", "gain", source="assumed")

    def step(self, t, h):
        self.y = self.k * self.u


class Pair(Component):
    """Two gains at once."""

    u = input("", "in", shape=(2,))
    y = output("", "out", shape=(2,))
    gain = parameter((1.0, 1.0), "", "gains", source="assumed")

    def step(self, t, h):
        for i in range(2):
            self.y[i] = self.gain[i] * self.u[i]


def fmu(cls: type[Component], build: Path, version: str = "2.0") -> Path:
    """A part's FMU, built once."""
    return exporter.build(cls, version, build / "tests")


def connector(name: str, kind: str, unit: str = "") -> str:
    """A connector of a real number."""
    said = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{said}/></ssd:Connector>'


def component(name: str, source: str, *connectors: str, more: str = "") -> str:
    """A component with connectors."""
    inside = f"<ssd:Connectors>{''.join(connectors)}</ssd:Connectors>" if connectors else ""
    return f'<ssd:Component name="{name}" source="{source}">{inside}{more}</ssd:Component>\n'


def connection(source: str, target: str, more: str = "", inside: str = "") -> str:
    """`a.y` to `b.u`; without a dot a connector of the system."""
    ends = ""
    for key, text in (("start", source), ("end", target)):
        element, _, name = text.rpartition(".")
        ends += f' {key}Element="{element}"' * bool(element) + f' {key}Connector="{name}"'
    return f"<ssd:Connection{ends} {more}>{inside}</ssd:Connection>\n"


def bindings(*values: str, more: str = "", mapping: str = "") -> str:
    """An inline parameter set of `name=value unit`."""
    lines = ""
    for one in values:
        name, _, text = one.partition("=")
        number, _, unit = text.partition(" ")
        lines += f'<ssv:Parameter name="{name}"><ssv:Real value="{number}"' + f' unit="{unit}"' * bool(unit)
        lines += "/></ssv:Parameter>\n"
    units = UNITS.replace("ssd:", "ssv:") if any(" " in one for one in values) else ""
    values_ = f'<ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>{lines}</ssv:Parameters>{units}'
    return (
        f"<ssd:ParameterBindings><ssd:ParameterBinding {more}><ssd:ParameterValues>{values_}</ssv:ParameterSet>"
        f"</ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def system(elements: str, connections: str = "", name: str = "root", before: str = "", after: str = "") -> str:
    """A system; `before`: connectors and bindings."""
    wires = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return f'<ssd:System name="{name}">{before}<ssd:Elements>\n{elements}</ssd:Elements>{wires}{after}</ssd:System>'


def description(
    root: str, experiment: str = '<ssd:DefaultExperiment stopTime="0.1"/>', name: str = "bench", version: str = "1.0"
) -> str:
    """A whole description."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<ssd:SystemStructureDescription {HEAD} name="{name}" '
        f'version="{version}">\n{root}\n{UNITS}\n{experiment}</ssd:SystemStructureDescription>\n'
    )


def packed(path: Path, text: str, files: dict[str, bytes | str | Path]) -> Path:
    """An SSP of a description and other files."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for name, content in files.items():
            archive.writestr(name, content.read_bytes() if isinstance(content, Path) else content)
    return path
