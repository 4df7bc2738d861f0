"""FMUs of the small parts, and a bench that makes, reads and runs SSPs of them."""

from pathlib import Path

import numpy as np
import pytest

from tests.ssp import parts
from twin.run import build_simulation, noop, resolve_catalogs, run_case
from twin.scenario import Backend, load_scenario, ssp_reader
from twin.ssp.model import Messages
from twin.ssp.package import variant
from twin.ssp.parser import SspParser


class Bench:
    """Makes an SSP in a folder of its own, and runs it."""

    def __init__(self, folder: Path, build: Path, fmus: dict[str, Path]):
        self.folder, self.build, self.fmus = folder, build, fmus

    def ssp(self, text: str, files: dict | None = None, name: str = "s.ssp") -> Path:
        """An SSP with the parts' FMUs in it."""
        return parts.packed(self.folder / name, text, {**self.fmus, **(files or {})})

    def run(self, path: Path, *overrides: str, variant: str = "") -> dict[str, np.ndarray]:
        """The recorded signals."""
        scenario = load_scenario(path, overrides)
        case = scenario.cases([variant] if variant else [])[0]
        simulated = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend.fmu, self.build)
        run_case(case, simulated, noop)
        recorded = simulated.recording().signals
        simulated.terminate()
        return recorded


@pytest.fixture(scope="session")
def part_fmus(build):
    """The parts as FMUs, by their place in an archive."""
    return {
        f"resources/{cls.__name__.lower()}.fmu": parts.fmu(cls, build) for cls in (parts.Ramp, parts.Spring, parts.Bare)
    }


@pytest.fixture
def bench(tmp_path, build, part_fmus):
    """A bench in a folder that only this test has; FMUs are unpacked there, too."""
    token = ssp_reader.BUILD.set(tmp_path / "build")
    yield Bench(tmp_path, build, part_fmus)
    ssp_reader.BUILD.reset(token)


@pytest.fixture
def read(tmp_path):
    """Parses texts of an unpacked SSP; its messages are in `read.messages`."""

    def reader(is_folder=False, outer=()):
        reader.messages = Messages()
        return SspParser(tmp_path, "s.ssp", reader.messages, tmp_path / "build", outer, is_folder)

    def root(text, **options):
        own = reader(**options)
        (tmp_path / "SystemStructure.ssd").write_text(text)
        return variant(own, "SystemStructure.ssd").system

    (tmp_path / "resources").mkdir()
    (tmp_path / "resources/a b.fmu").write_bytes(b"")
    (tmp_path / "a.fmu").write_bytes(b"")
    reader.root, reader.folder = root, tmp_path
    return reader
