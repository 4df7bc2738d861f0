"""The library of every FMU exports the functions of FMI, and needs the mathematical library alone."""

import zipfile

import pytest

from tests.fmi.loaded import symbols
from twin import catalog, compiled, conformance
from twin.fmi import exporter


@pytest.mark.skipif(compiled.host() != "x86_64-linux", reason="reads the symbols of a Linux library")
@pytest.mark.parametrize("version", conformance.VERSIONS)
@pytest.mark.parametrize("name", catalog.names())
def test_symbols(name, version, build, tmp_path):
    with zipfile.ZipFile(exporter.build(catalog.component(name), version, build)) as archive:
        library = next(entry for entry in archive.namelist() if entry.endswith(".so"))
        defined, needed = symbols(tmp_path / archive.extract(library, tmp_path))
    assert defined
    assert all(symbol.startswith(f"fmi{version[0]}") for symbol in defined)
    assert needed <= compiled.LIBM | {"sincos"}  # glibc's libm has both in one; the code generator knows
