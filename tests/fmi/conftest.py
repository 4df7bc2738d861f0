"""FMUs of the small components, made once for all tests of this folder."""

import pytest
from fmpy import extract

from tests.fmi.loaded import VERSIONS
from tests.fmi.parts import PARTS
from twin.fmi import exporter


@pytest.fixture(scope="session")
def fmus(build, tmp_path_factory):
    """All parts as FMUs of both versions: (archive, folder it is unpacked in)."""
    result = {}
    for part in PARTS:
        for version in VERSIONS:
            path = exporter.build(part, version, build / "tests")
            folder = tmp_path_factory.mktemp(part.__name__)
            extract(str(path), str(folder))
            result[part, version] = path, folder
    return result
