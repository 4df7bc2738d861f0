"""Shared options and the former spellings of renamed ones."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from tests.every_case import every_case
from twin.cli import group
from twin.cli.options import RenamedOption, option, refuse_existing
from twin.errors import TwinError

FORMER = {
    "run": {"--as": "--backend", "--form": "--backend", "--dry": "--dry-run", "--half-step": "--step-refinement"},
    "console": {"--as": "--backend"},
    "profile": {"--form": "--backend"},
    "check": {"--coupling": "--stability"},
    "list": {"--matching": "--filter"},
    "describe": {"--matching": "--filter"},
    "view": {"--export": "--output"},
}


def command_of(name):
    return group.get_command(click.Context(group), name)


@every_case("name", FORMER)
def test_former_spellings_are_hidden(name):
    command = command_of(name)
    former = {
        spelling: max(parameter.opts, key=len)
        for parameter in command.params
        if isinstance(parameter, RenamedOption)
        for spelling in parameter.former
    }
    assert FORMER[name].items() <= former.items()
    words = CliRunner().invoke(command, ["--help"]).output.replace(",", " ").split()
    assert set(former).isdisjoint(words)
    assert set(former.values()) <= set(words)


@click.command()
@option("--backend", former=("--as", "--form"), type=click.Choice(["fmu", "compiled"]), default="fmu")
@option("--dry-run", former=("--dry",), is_flag=True)
@option("--filter", "texts", former=("--matching",), multiple=True)
@option("--output", "-o", former=("--export",), type=click.Path(path_type=Path))
def sample(**options):
    click.echo(sorted(options.items()))


NOW = {"backend": "fmu", "dry_run": False, "texts": (), "output": None}


@every_case(
    ("arguments", "changed", "old", "new"),
    [
        ("--as compiled", {"backend": "compiled"}, "--as", "--backend"),
        ("--form=compiled", {"backend": "compiled"}, "--form", "--backend"),
        ("--dry", {"dry_run": True}, "--dry", "--dry-run"),
        ("--matching a --filter b --matching c", {"texts": ("a", "c", "b")}, "--matching", "--filter"),
        ("--export x.csv", {"output": Path("x.csv")}, "--export", "--output"),
        ("--as fmu --backend compiled", {"backend": "compiled"}, "--as", "--backend"),
    ],
)
def test_a_former_spelling_acts_with_a_note(arguments, changed, old, new):
    done = CliRunner().invoke(sample, arguments.split())
    assert done.stdout == f"{sorted((NOW | changed).items())}\n"
    assert done.stderr == f"note: {old} is now {new}; the old spelling ends with the next release.\n"


def test_a_present_spelling_needs_no_note():
    done = CliRunner().invoke(sample, ["--backend", "compiled", "--dry-run", "--filter", "a", "-o", "x.csv"])
    assert (
        done.output
        == f"{sorted({'backend': 'compiled', 'dry_run': True, 'texts': ('a',), 'output': Path('x.csv')}.items())}\n"
    )


def test_an_error_names_the_present_spelling():
    done = CliRunner().invoke(sample, ["--as", "fast"])
    assert done.exit_code == 2
    assert "Invalid value for '--backend'" in done.stderr


@pytest.mark.slow
def test_lists_with_the_former_filter():
    done = CliRunner().invoke(group, ["list", "components", "--matching", "servomotor"])
    assert "servomotor" in done.stdout
    assert "note: --matching is now --filter" in done.stderr


def test_only_force_replaces_a_file(tmp_path):
    file = tmp_path / "a.csv"
    refuse_existing(file, force=False)
    file.touch()
    refuse_existing(file, force=True)
    with pytest.raises(TwinError, match=r"a\.csv exists\. Use --force"):
        refuse_existing(file, force=False)
