"""FMUs of Python-side components: PythonFMU's library around Python, a description of ours, and a component outside.

These are the only FMUs here that need Python, with this project and the component's packages installed, in the process
that loads them; `needsExecutionTool` says so. All others are native (`twin.fmi.exporting.exporter`).
"""

from __future__ import annotations

import hashlib
import uuid
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from twin import compiler, installed
from twin.component import PythonComponent, catalog
from twin.errors import BuildError, DeclarationError
from twin.files import write_atomically
from twin.fmi.exporting import model_description_writer
from twin.fmi.exporting.exporter import VERSIONS, archive
from twin.fmi.exporting.pythonfmu_slave import EXPOSE, PACKAGES
from twin.fmi.fmi_version import FMI2

if TYPE_CHECKING:
    from twin.component import Component


# PythonFMU's library finds the class by the text of its first line
SCRIPT = '''"""{summary}

Made by twin {twin}. Needs Python with twin, {package} and what the component imports.
"""

from {package} import {base}
from twin.fmi.exporting.pythonfmu_slave import Part


class {name}({base}):
    def __init__(self, **given):
        super().__init__(**given)
        self.time = 0.0
        self.part = Part(self, {component!r}, {version!r})

    def setup_experiment(self, start_time, *_):
        self.time = start_time

    def enter_initialization_mode(self):
        self.part.enter(self.time)

    def exit_initialization_mode(self):
        self.part.exit()

    def do_step(self, current_time, step_size):
        self.part.step(current_time, step_size)
        self.time = current_time + step_size
        return True

    def terminate(self):
        self.part.close()
'''

# what PythonFMU does not do, whatever a native FMU of the same component would
REFUSED = (
    *("canGetAndSetFMUState", "canSerializeFMUState", "canGetAndSetFMUstate", "canSerializeFMUstate"),
    *("providesDirectionalDerivatives", "providesDirectionalDerivative", "providesIntermediateUpdate"),
    *("canReturnEarlyAfterIntermediateUpdate", "hasEventMode", "mightReturnEarlyFromDoStep"),
)


def export(cls: type[Component], version: str, path: Path) -> Path:
    """Write a Python-side component as an FMU that needs Python; BuildError if it cannot be one."""
    if not issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: needs no Python in its FMU. Export it without --needs-python.")
    name = compiler.model_name(cls)
    component = findable(cls, name)
    (package, prefix), describe = PACKAGES[version], VERSIONS[version].describe
    try:
        folder = Path(str(metadata.distribution(package).locate_file(package)))
    except metadata.PackageNotFoundError:
        raise BuildError(f"{name}: {package} is not installed. Run `pip install {package}`.") from None
    exposed = EXPOSE[version](cls)
    blank = describe(cls, name, "", exposed)
    token = f"{{{uuid.UUID(hashlib.sha256(blank + component.encode()).hexdigest()[:32])}}}"
    script = SCRIPT.format(
        summary=model_description_writer.summary(cls),
        twin=installed.version("catheter-twin"),
        package=package,
        base=f"{prefix}Slave",
        name=name,
        component=component,
        version=version,
    )
    files = {
        "modelDescription.xml": honest(describe(cls, name, token, exposed)),
        "resources/slavemodule.txt": module(name, version).encode(),
        f"resources/{module(name, version)}.py": script.encode(),
        **{f"resources/{package}/{file.name}": file.read_bytes() for file in sorted(folder.glob("*.py"))},
        **binaries(folder / "resources" / "binaries", name, version),
    }
    write_atomically(path, archive(files))
    return path


def module(name: str, version: str) -> str:
    """The module that PythonFMU imports: Python knows each name once."""
    return f"{name}_fmi{version[0]}"


def findable(cls: type[Component], name: str) -> str:
    """What finds the component again in another process: its short name, or module:Class."""
    for text in (name, f"{cls.__module__}:{cls.__qualname__}"):
        try:
            if catalog.component(text) is cls:
                return text
        except DeclarationError:
            continue
    raise BuildError(f"{cls.__name__}: cannot be found from another process. Put it into a module of its own.")


def honest(document: bytes) -> bytes:
    """The description with the attributes of an FMU that needs Python."""
    root = etree.fromstring(document)
    interface = root.find("CoSimulation")
    interface.set("needsExecutionTool", "true")
    for word in REFUSED:
        interface.attrib.pop(word, None)
    root.set("description", f"{root.get('description')} Needs Python with catheter-twin.")
    return model_description_writer.serialized(root)


def binaries(folder: Path, name: str, version: str) -> dict[str, bytes]:
    """PythonFMU's library for each platform that it has, by its path in the FMU."""
    platforms = {
        FMI2.platform_folder(p) if version == FMI2.number else p: platform for p, platform in compiler.PLATFORMS.items()
    }
    libraries = {}
    for platform_folder, platform in platforms.items():
        for library in sorted((folder / platform_folder).glob(f"*{platform.suffix}")):
            libraries[f"binaries/{platform_folder}/{name}{platform.suffix}"] = library.read_bytes()
    return libraries
