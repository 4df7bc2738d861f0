"""Add the proxy of the FMU Manipulation Toolbox to an FMU for 32-bit Linux: `python docs/remoting_32_bit.py FMU NEW_FMU`.

See docs/how-to/remote_members.md. The proxy saves no states and gives no derivatives, so the description loses these flags.
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

import fmu_manipulation_toolbox
from lxml import etree

UNSUPPORTED = ("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative", "canInterpolateInputs")


def add_proxy(source: str, target: str) -> None:
    """Write a copy of an FMU with client, server and table of value references."""
    tool = Path(fmu_manipulation_toolbox.__file__).parent / "resources"
    with zipfile.ZipFile(source) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    description = etree.fromstring(files["modelDescription.xml"])
    interface = description.find("CoSimulation")
    for flag in UNSUPPORTED:
        interface.attrib.pop(flag, None)
    references: dict[str, list[int]] = {kind: [] for kind in ("Real", "Integer", "Boolean")}
    for variable in description.iterfind("ModelVariables/ScalarVariable"):
        for kind, numbers in references.items():
            if variable.find(kind) is not None:
                numbers.append(int(variable.get("valueReference")))
    table = [len(numbers) for numbers in references.values()]
    table += [number for numbers in references.values() for number in sorted(numbers)]
    files["modelDescription.xml"] = etree.tostring(description, xml_declaration=True, encoding="UTF-8")
    files["resources/remoting_table.txt"] = "".join(f"{line}\n" for line in table).encode()
    files["binaries/linux32/server_sm"] = (tool / "linux32" / "server_sm").read_bytes()
    files[f"binaries/linux64/{interface.get('modelIdentifier')}.so"] = (tool / "linux64" / "client_sm.so").read_bytes()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)


if __name__ == "__main__":
    add_proxy(sys.argv[1], sys.argv[2])
