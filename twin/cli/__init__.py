"""The command line: one file per command, imported only when it is called, so that `twin --help` is quick.

Packages above the engine add theirs as entry points of the group `twin.commands`, so that `twin` need not know them.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from functools import cache
from importlib.metadata import EntryPoint, entry_points

import click

from twin import __version__
from twin.errors import TwinError

COMMANDS = {
    "run":       "run a scenario: all variants and seeds, metrics, report",
    "check":     "find every mistake in scenario files without running them",
    "simulate":  "run any single FMU and write its outputs",
    "build":     "build all components of fmus/ as FMUs",
    "test":      "check that a component does the same interpreted, compiled and as FMU",
    "reference": "write the trajectory that a component must reproduce",
    "export":    "a component, or any part of a scenario, as one FMU",
    "calibrate": "readings of a bench, as CSV files, to the parameters of a component",
    "new":       "write a new component folder that builds and passes its tests",
}  # fmt: skip


@cache
def added() -> dict[str, EntryPoint]:
    """Commands of installed packages, by name."""
    return {point.name: point for point in sorted(entry_points(group="twin.commands"), key=lambda point: point.name)}


class Commands(click.Group):
    """A group whose commands are modules of this package, or added by others."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which one meets them."""
        return [*COMMANDS, *added()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module."""
        if cmd_name in added():
            other: click.Command = added()[cmd_name].load()
            return other
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"twin.cli.{cmd_name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name the nearest one."""
        if args and args[0] not in self.list_commands(ctx) and not args[0].startswith("-"):
            from twin.coupling import nearest

            ctx.fail(f"no command {args[0]!r}. {nearest(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, importing only those of others."""
        others = [(name, point.load().get_short_help_str(limit=90)) for name, point in added().items()]
        with formatter.section("Commands"):
            formatter.write_dl([*COMMANDS.items(), *others])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="twin")
def group() -> None:
    """Digital twins of robotic catheters: components as native FMUs, coupled by a compiled loop.

    \b
    twin run scenarios/heart_wall_force.yaml     the force experiment of paper A
    twin simulate pump.fmu --stop-time 10        any FMU, FMI 2.0 or 3.0
    twin new my_part && twin build my_part       your own component
    """


def main() -> None:
    """Run the command line."""
    invoke(group, "twin")


def invoke(command: click.Command, name: str) -> None:
    """Run a command; an expected failure is one line on stderr and exit code 1. SIGTERM ends it like Ctrl-C.

    So does SIGINT where a script's background jobs would ignore it: what may move a machine has to be stoppable.
    """
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, signal.default_int_handler)
    try:
        command(prog_name=name, standalone_mode=False)
    except TwinError as error:
        for line in str(error).splitlines():
            click.echo(f"error: {line}", err=True)
        sys.exit(1)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:  # before OSError, of which it is one
        # who read our output has seen enough; nothing may be flushed into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        click.echo(f"error: {place}{error.strerror or error}. Check the path, its permissions and the disk.", err=True)
        sys.exit(1)
