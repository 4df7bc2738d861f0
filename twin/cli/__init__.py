"""The command line: one module per command, imported only when the command is called, so that `twin --help` starts quickly.

Packages above the engine add commands by entry points (`plugins`).
"""

from __future__ import annotations

import errno
import gc
import importlib
import logging
import os
import sys
from contextlib import suppress
from pathlib import Path

import click

from twin import __version__
from twin.cli.plugins import plugin_commands, summary
from twin.cli.terminal import NoteHandler, handle_broken_pipe, line_width, open_streams, say, show_error, wrap_text
from twin.errors import TwinError, nearest, printable
from twin.process import command_line, end, handle_signals, is_interrupted, memory_is_limited

__all__ = ["group", "invoke", "main", "say"]


COMMANDS = {  # by task
    "Run and look": {
        "demo": "show three commands to begin with, as `twin` alone does",
        "list": "list scenarios, studies, components, drive profiles and runs",
        "describe": "show units and bounds of what `twin list` names, or of an FMU",
        "run": "run a scenario: all variants and seeds, metrics, report",
        "view": "view runs or a scene in the browser; write HTML, CSV, MAT, MCAP",
        "console": "operate a scenario live in the browser",
        "compare": "compare two runs: signals, metrics, verdicts",
        "resume": "continue an interrupted run from its last checkpoint",
        "branch": "continue a run from a point in time with changed values",
    },
    "Check": {
        "check": "validate scenario files without running them",
        "graph": "show the coupling structure: order, periods, delays, loops",
        "profile": "measure the computing time of each member",
    },
    "Build and export": {
        "new": "create a component or a project from a template",
        "test": "check that a component gives equal results with all backends",
        "reference": "record a component's reference trajectory (expected.csv)",
        "build": "build the components of fmus/ as FMUs",
        "simulate": "simulate a single FMU and write its outputs",
        "export": "export a component or a part of a scenario as one FMU or SSP",
    },
    "Identify and study": {
        "calibrate": "calibrate a component from bench measurements (CSV)",
        "identify": "fit the parameters of a model to recordings (CSV, CAN traces)",
        "validate": "predict measured data with frozen parameters; cross-validate",
        "follow": "estimate states and parameters along a recording or running rig",
        "study": "run a Monte Carlo, sensitivity, worst-case or tuning study",
    },
    "Housekeeping": {
        "recover": "recover the results of an interrupted run",
        "cache": "show or clear the cache of generated code and FMUs",
    },
}
NAMES = tuple(name for commands in COMMANDS.values() for name in commands)
HARDWARE = "Hardware and plug-ins"  # heading of the commands of other packages


class Commands(click.Group):
    """A group whose commands are modules of this package or entry points of others."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of a typical workflow."""
        return [*NAMES, *plugin_commands()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module."""
        if cmd_name in NAMES:
            command: click.Command = importlib.import_module(f"twin.cli.{cmd_name}").command
            return command
        if cmd_name not in plugin_commands():
            return None
        plugin: click.Command = plugin_commands()[cmd_name].load()
        return plugin

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; suggest the nearest name if there is none."""
        if args and not args[0].startswith("-") and args[0] not in NAMES and args[0] not in plugin_commands():
            ctx.fail(f"no command {args[0]!r}. {nearest(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by task, without importing them."""
        groups = {**COMMANDS, HARDWARE: {name: summary(name) for name in plugin_commands()}}
        groups["Housekeeping"] = groups.pop("Housekeeping")  # last
        width = max(map(len, self.list_commands(ctx)))
        for heading, commands in groups.items():
            if commands:
                with formatter.section(heading):
                    formatter.write_dl([(name.ljust(width), text) for name, text in commands.items()])


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(__version__, prog_name="twin")
@click.pass_context
def group(context: click.Context) -> None:
    """Digital twins of robotic catheters: native FMUs, coupled by a compiled co-simulation master.

    \b
    twin run heart_wall_force               force control against a beating wall
    twin simulate pump.fmu --stop-time 10   any FMU, FMI 2.0 or 3.0
    twin new my_part && twin build my_part  your own component
    """
    if context.invoked_subcommand is None:
        from twin.cli.demo import show_examples

        show_examples()


def main() -> None:
    """Run the command line.

    Linear algebra uses one thread: the order of sums then does not depend on the number of cores, and no matrix here is
    large enough to be worth the start of threads.
    """
    gc.set_threshold(200_000, 20, 20)  # what a start creates stays; looking through it again and again takes 0.3 s
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search opens files of all packages
    invoke(group, "twin")


def invoke(command: click.Command, name: str) -> None:
    """Run a command and end the process.

    An expected failure is one line on stderr and exit code 1; signals act like Ctrl-C.
    """
    try:
        handle_signals()
        open_streams()
        command_line()
        stdout = sys.stdout
        code = run_command(command, name)
        stdout.flush()
        if sys.stdout is not stdout:  # click has replaced it after a broken pipe
            code = handle_broken_pipe()
    except BrokenPipeError:
        code = handle_broken_pipe()
    except KeyboardInterrupt:
        code = report_interruption()
    except Exception:
        if not is_interrupted():
            raise
        code = report_interruption()  # interrupted code may fail in any way
    end(code)


def report_interruption() -> int:
    """Print that a signal ended the command; return its exit code."""
    with suppress(OSError):  # the terminal may be closed
        say("interrupted", err=True)
    return 130


def run_command(command: click.Command, name: str) -> int:
    """Run a command and return its exit code."""
    try:
        refuse_bytes([*sys.argv[1:], str(Path.cwd())])
        logging.getLogger("twin").addHandler(NoteHandler())
        command(prog_name=name, standalone_mode=False)
    except SystemExit as error:
        if not isinstance(error.code, int):
            raise
        return error.code
    except BrokenPipeError:  # a subclass of OSError
        raise
    except click.exceptions.NoArgsIsHelpError as error:  # its message is the help text
        error.show()
        return error.exit_code
    except click.ClickException as error:
        lines = wrap_text(error.message, "Error: ", line_width(sys.stderr))
        error.__dict__["message"] = "\n".join(begin + words for begin, words in lines).removeprefix("Error: ")
        error.show()
        return error.exit_code
    except (TwinError, OSError, MemoryError) as error:
        for line in error_lines(error):
            details = line.removeprefix("  ")  # of the line before
            show_error(details, "error: " if details == line else "  ")
        return 1
    except (click.Abort, KeyboardInterrupt):  # Abort is a subclass of RuntimeError
        return report_interruption()
    except (ImportError, SystemError, RuntimeError) as error:  # RuntimeError: no memory for a thread
        if not memory_is_limited():
            raise
        say(f"error: {error_lines(MemoryError(' '.join(str(error).split())[-120:]))[0]}", err=True)
        return 1
    return 0


def refuse_bytes(arguments: list[str]) -> None:
    """Raise UsageError for an argument that is not UTF-8: recordings and reports could not name such a file."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError as error:
            byte = os.fsencode(argument[error.start])[0]
            raise click.UsageError(
                f"{printable(argument)}: byte 0x{byte:02x} is not UTF-8 text. Rename the file or folder."
            ) from None


def error_lines(error: TwinError | OSError | MemoryError) -> list[str]:
    """Return the message of an expected failure, as lines."""
    if isinstance(error, TwinError):
        return str(error).split("\n")
    if isinstance(error, MemoryError):
        return [f"not enough memory{f' ({error})' if str(error) else ''}. Record less, or raise the limit (ulimit -v)."]
    if error.errno == errno.ENOMEM:
        return error_lines(MemoryError())
    prefix = f"{error.filename}: " if error.filename else ""
    if error.errno == errno.ENOSPC:
        return [f"{prefix}the disk is full. Free some space; files written before are complete."]
    return [f"{prefix}{error.strerror or error}. Check the path, its permissions and the disk."]
