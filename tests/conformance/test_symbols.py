"""The library of every FMU exports the functions of FMI, and needs the mathematical library alone."""

import zipfile
from itertools import product

import pytest

from tests.conformance.test_components import EVERY_KIND, NATIVE
from tests.fmi.loaded import symbols
from tests.matrix import some
from twin import compiler
from twin.component import Component, catalog, input, local, output
from twin.conformance import agreement as conformance
from twin.conformance import reference
from twin.fmi.exporting import exporter

LINUX = pytest.mark.skipif(compiler.host() != "x86_64-linux", reason="reads the symbols of a Linux library")
LONG, SHORT = 300, 40


class Blocks(Component):
    """Fills, copies and shifts arrays, of which a compiler likes to make calls of memset, memcpy and memmove."""

    u = input("m", "what is stored")
    y = output("m", "mean of all that is kept")

    line = local(0.0, "m", "delay line", shape=(LONG,))
    copy = local(0.0, "m", "its last state", shape=(LONG,))
    few = local(0.0, "m", "rows, filled in part", shape=(SHORT, 4))

    def initialize(self):
        for i in range(LONG):
            self.line[i] = 0.0
            self.copy[i] = 0.0
        for i in range(SHORT):
            for j in range(4):
                self.few[i, j] = 0.0
        self.y = 0.0

    def step(self, t, h):
        for i in range(LONG):
            self.copy[i] = self.line[i]
        for i in range(LONG - 1):
            self.line[LONG - 1 - i] = self.line[LONG - 2 - i]
        self.line[0] = self.u
        if self.u < 0.0:
            for i in range(LONG):
                self.line[i] = 0.0
        count = min(max(int(20.0 * self.u), 0), SHORT)
        for i in range(count):
            for j in range(4):
                self.few[i, j] = 0.0
        self.few[count % SHORT, 1] = self.u
        total = 0.0
        for i in range(LONG):
            total += self.copy[i] + self.line[i]
        for i in range(SHORT):
            total += self.few[i, 1]
        self.y = total / LONG


def of_library(path, folder):
    """(defined, needed) symbols of an FMU's library for Linux."""
    with zipfile.ZipFile(path) as archive:
        library = next(entry for entry in archive.namelist() if entry.endswith(".so"))
        return symbols(folder / archive.extract(library, folder))


def assert_only_mathematics(version, defined, needed):
    assert defined
    assert all(symbol.startswith(f"fmi{version[0]}") for symbol in defined)
    assert needed <= compiler.LIBM | {"sincos"}  # glibc's libm has both in one; the code generator knows


@pytest.mark.slow_repetitions
@LINUX
@pytest.mark.parametrize(
    ("name", "version"),
    some(product(NATIVE, conformance.VERSIONS), lambda case: case[1] == "3.0" or case[0] in EVERY_KIND),
)
def test_symbols(name, version, build, tmp_path):
    path = exporter.build(catalog.component(name), version, build)
    assert_only_mathematics(version, *of_library(path, tmp_path))


@pytest.mark.slow
@LINUX
@pytest.mark.parametrize("version", conformance.VERSIONS)
def test_fills_and_copies_call_nothing(version, build, tmp_path):
    assert_only_mathematics(version, *of_library(exporter.build(Blocks, version, build / "tests"), tmp_path))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", [*compiler.PLATFORMS, *compiler.BARE])
def test_fills_and_copies_call_nothing_on_other_platforms(target, build):
    code = compiler.component_object(Blocks, target, build / "tests", "blocks")
    assert b"blocks_step" in code
    assert not [word for word in (b"memset", b"memcpy", b"memmove", b"memclr", b"bzero") if word in code]


@pytest.mark.slow
@pytest.mark.parametrize("check", ["compiled", "fmu"])
def test_fills_and_copies_give_the_same_in_every_form(check, build, monkeypatch):
    monkeypatch.setattr(conformance, "read_expected", reference.record_reference)
    conformance.CHECKS[check](Blocks, build / "tests")
    assert max(abs(row[-1]) for row in reference.record_reference(Blocks).rows) > 1e-3
