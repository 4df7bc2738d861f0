"""What is compiled of an FMU that has only sources, with which options: FMI 2.0 lists files, FMI 3.0 has a file for it."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import etree

from tests.every_case import every_case
from twin import compiler
from twin.errors import BuildError, FMUError
from twin.fmi.exporting import sources
from twin.fmi.fmi_version import FMI2, FMI3
from twin.fmi.importing import foreign_sources

PATH = Path("a.fmu")


def of_version_3(text, identifier="m"):
    """What is compiled by a buildDescription.xml with these configurations."""
    xml = f'<fmiBuildDescription fmiVersion="3.0">{text}</fmiBuildDescription>'.encode()
    description = SimpleNamespace(fmi=FMI3, identifier=identifier)
    return foreign_sources.description_of_build(PATH, description, {"buildDescription.xml": xml})


def configuration(inside, more="", identifier="m"):
    """A configuration of the build."""
    return f'<BuildConfiguration modelIdentifier="{identifier}" {more}>{inside}</BuildConfiguration>'


def test_files_of_version_2():
    xml = (
        '<a><ModelExchange><SourceFiles><File name="x.c"/></SourceFiles></ModelExchange><CoSimulation><SourceFiles>'
        '<File name="b.c"/><File name="a.c"/></SourceFiles></CoSimulation></a>'
    )
    description = SimpleNamespace(fmi=FMI2, interface="CoSimulation", tree=etree.fromstring(xml))
    assert foreign_sources.description_of_build(PATH, description, {}) == (["b.c", "a.c"], ())
    description.interface = "none"
    with pytest.raises(FMUError, match=r"^a.fmu: has sources but does not list them. Export it with a library"):
        foreign_sources.description_of_build(PATH, description, {})


def test_files_and_options_of_version_3():
    sets = (
        '<SourceFileSet language="C99" compilerOptions="-O2 &apos;-DTEXT=a b&apos;"><SourceFile name="a.c"/>'
        '<SourceFile name="b.c"/><PreprocessorDefinition name="ON"/><PreprocessorDefinition name="N" value="3"/>'
        '<PreprocessorDefinition name="NONE" value=""/><IncludeDirectory name="inc"/></SourceFileSet>'
        '<SourceFileSet><SourceFile name="c.c"/></SourceFileSet>'
        '<Library name="m" external="true"/><Library name="own" external="false"/><Library name="its"/>'
    )
    assert of_version_3(configuration(sets)) == (
        ["a.c", "b.c", "c.c"],
        ("-O2", "-DTEXT=a b", "-DON", "-DN=3", "-DNONE=", "-Iinc", "-lm"),
    )


def test_the_configuration_of_this_machine_is_used_else_that_of_all():
    def named(name, more="", identifier="m"):
        return configuration(f'<SourceFileSet><SourceFile name="{name}"/></SourceFileSet>', more, identifier)

    here, other = f'platform="{compiler.host()}"', 'platform="pdp11-unix"'
    every = named("other_model.c", "", "n") + named("other.c", other) + named("all.c") + named("here.c", here)
    assert of_version_3(every)[0] == ["here.c"]
    assert of_version_3(every.replace(here, other))[0] == ["all.c"]
    assert of_version_3(every, "n")[0] == ["other_model.c"]
    with pytest.raises(FMUError, match=rf"has no configuration for {compiler.host()}. Export it with a library"):
        of_version_3(named("other.c", other))


@every_case("language", ["C", "c", "C89", "C90", "C99", "C11", "C17", "C++", "c++14"])
def test_languages_that_are_compiled(language):
    found = of_version_3(
        configuration(f'<SourceFileSet language="{language}"><SourceFile name="a.c"/></SourceFileSet>')
    )
    assert found == (["a.c"], ())


@pytest.mark.parametrize("language", ["Fortran", "C#", "Objective-C", "C2"])
def test_other_languages_are_refused(language):
    with pytest.raises(FMUError, match=f"sources in {language} cannot be compiled here"):
        of_version_3(configuration(f'<SourceFileSet language="{language}"/>'))


def test_sources_that_are_not_there():
    description = SimpleNamespace(fmi=FMI3, identifier="m")
    with pytest.raises(FMUError, match=r"^a.fmu: has no sources/buildDescription.xml"):
        foreign_sources.build_sources(PATH, description, {})
    listed = '<SourceFileSet><SourceFile name="a.c"/><SourceFile name="b.c"/></SourceFileSet>'
    text = f"<a>{configuration(listed)}</a>"
    with pytest.raises(FMUError, match=r"^a.fmu: sources/b.c is listed, but not in the FMU"):
        foreign_sources.build_sources(PATH, description, {"buildDescription.xml": text.encode(), "a.c": b""})


# --- what an export lists


def test_files_of_an_export():
    """The state machine of the version, the model and its own files; FMI 3.0 has a description of the build."""
    for version, other, machine in (("2.0", "fmi3", "fmi2"), ("3.0", "fmi2", "fmi3")):
        files = sources.source_files("m", version, "int x;", {"m.c": b"1", "m.h": b"2"})
        assert (files["sources/model.c"], files["sources/m.c"], files["sources/m.h"]) == (b"int x;", b"1", b"2")
        names = [path.removeprefix("sources/") for path in files]
        assert any(name.startswith(machine) for name in names)
        assert not any(name.startswith(other) for name in names)
        assert ("buildDescription.xml" in names) == (version == "3.0")
    assert sources.to_compile({"sources/b.c": b"", "sources/a.c": b"", "sources/a.h": b"", "x.c": b""}) == [
        "a.c",
        "b.c",
    ]
    with pytest.raises(BuildError, match=r"^m: model\.c would be in `sources` twice\. Rename the component\.$"):
        sources.source_files("m", "2.0", "", {"Model.c": b""})


def test_the_description_of_an_export_is_read_as_it_was_written():
    """For every platform; options that keep its arithmetic only where they are known."""
    made = sources.build_description("m", ["a.c", "b.c"])
    description = SimpleNamespace(fmi=FMI3, identifier="m")
    found = foreign_sources.description_of_build(PATH, description, {"buildDescription.xml": made})
    assert found[0] == ["a.c", "b.c"]
    configurations = [
        (one.get("platform"), one[0].get("compilerOptions"), [child.get("name") for child in one.iterfind("Library")])
        for one in etree.fromstring(made)
    ]
    off = "-ffp-contract=off -fwrapv"
    assert configurations == [
        (None, None, []),
        ("x86_64-linux", off, ["m"]),
        ("aarch64-linux", off, ["m"]),
        ("x86_64-darwin", off, []),
        ("aarch64-darwin", off, []),
    ]
    assert {one[0].get("language") for one in etree.fromstring(made)} == {"C11"}


def test_the_list_of_version_2_comes_first_in_both_interfaces():
    made = etree.fromstring(
        sources.listed(b"<a><ModelExchange><x/></ModelExchange><CoSimulation><x/></CoSimulation></a>", ["b.c", "a.c"])
    )
    assert [[child.tag for child in interface] for interface in made] == [["SourceFiles", "x"]] * 2
    assert [[file.get("name") for file in interface[0]] for interface in made] == [["b.c", "a.c"]] * 2
