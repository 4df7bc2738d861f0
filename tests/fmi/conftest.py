"""FMUs of the small components, made when a test asks for them, once for all tests of this folder."""

from collections.abc import Iterator

import pytest
from fmpy import extract
from fmpy.fmi1 import _FMU

from twin.fmi.exporting import exporter


class Built(dict):
    """(component, version) -> (archive, folder it is unpacked in)."""

    def __init__(self, build, folders):
        super().__init__()
        self.build, self.folders = build, folders

    def __missing__(self, key):
        part, version = key
        path = exporter.build(part, version, self.build / "tests")
        folder = self.folders.mktemp(part.__name__)
        extract(str(path), str(folder))
        self[key] = path, folder
        return self[key]


@pytest.fixture(scope="session", autouse=True)
def fmpy_settles() -> Iterator[None]:
    """FMPy leaves to PythonFMU's library what it does wrong when the process ends (`Library.settle`)."""
    free = _FMU.freeLibrary

    def settled(fmu: _FMU) -> None:
        getattr(fmu.dll, "finalizePythonInterpreter", lambda: None)()
        free(fmu)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_FMU, "freeLibrary", settled)
        yield


@pytest.fixture(scope="session")
def fmus(build, tmp_path_factory):
    """All parts as FMUs of both versions."""
    return Built(build, tmp_path_factory)
