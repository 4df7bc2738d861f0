"""What is compiled of an FMU that has only sources, with which options: FMI 2.0 lists files, FMI 3.0 has a file for it."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import etree

from twin import compiler
from twin.errors import FMUError
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


@pytest.mark.parametrize("language", ["C", "c", "C89", "C90", "C99", "C11", "C17", "C++", "c++14"])
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
