"""The command line: one file per command, imported only when it is called, so that `twin --help` is quick.

Packages above the engine add theirs (`added`).
"""

from __future__ import annotations

import atexit
import errno
import gc
import importlib
import os
import sys
from contextlib import suppress

import click

from twin import __version__
from twin.cli.added import added, summary
from twin.cli.terminal import nobody_reads, open_streams, say
from twin.errors import TwinError, nearest, printable
from twin.process import command_line, end, handle_signals, is_interrupted, memory_is_limited

__all__ = ["group", "invoke", "main", "say"]

COLLECT_EVERY = 200_000  # new objects, more than a short run makes: to look through 50,000 takes 20 ms. By default 700

COMMANDS = {
    "list":      "components, scenarios, drive profiles and runs, one line each",
    "describe":  "variables, units, bounds and sources of a component, scenario or FMU",
    "run":       "run a scenario: all variants and seeds, metrics, report",
    "study":     "a scenario many times with what varies: spread, causes, worst case, tuning",
    "recover":   "finish a run that was killed, from what it recorded",
    "check":     "find every mistake in scenario files without running them",
    "graph":     "the system that a scenario couples: order, periods, delays, loops",
    "profile":   "which member of a scenario costs what",
    "simulate":  "run any single FMU and write its outputs",
    "build":     "build all components of fmus/ as FMUs",
    "test":      "check that a component does the same interpreted, compiled and as FMU",
    "reference": "write the trajectory that a component must reproduce",
    "export":    "a component, or any part of a scenario, as one FMU",
    "compare":   "whether two runs are the same: signals, metrics, verdicts",
    "view":      "runs in the browser, as a page, CSV, MAT or MCAP; play a run; draw an environment",
    "console":   "a scenario live in the browser: watch, operate, stop",
    "calibrate": "readings of a bench, as CSV files, to the parameters of a component",
    "identify":  "recordings, of a bus too, to the parameters of any model",
    "new":       "write a new component folder that builds and passes its tests",
}  # fmt: skip


class Commands(click.Group):
    """A group whose commands are modules of this package, or added by others."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which one meets them."""
        return [*COMMANDS, *added()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module."""
        if cmd_name in COMMANDS:
            command: click.Command = importlib.import_module(f"twin.cli.{cmd_name}").command
            return command
        if cmd_name not in added():
            return None
        other: click.Command = added()[cmd_name].load()
        return other

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name the nearest one."""
        if args and not args[0].startswith("-") and args[0] not in COMMANDS and args[0] not in added():
            ctx.fail(f"no command {args[0]!r}. {nearest(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, importing none of them."""
        others = [(name, summary(name)) for name in added()]
        with formatter.section("Commands"):
            formatter.write_dl([*COMMANDS.items(), *others])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="twin")
def group() -> None:
    """Digital twins of robotic catheters: components as native FMUs, coupled by a compiled loop.

    \b
    twin run heart_wall_force                    the force experiment of paper A
    twin simulate pump.fmu --stop-time 10        any FMU, FMI 2.0 or 3.0
    twin new my_part && twin build my_part       your own component
    """


def main() -> None:
    """Run the command line.

    Hundreds of modules are imported, nothing of them is garbage, and no plugin of pydantic has a say in scenario files.
    Linear algebra keeps to one thread: sums have one order then, on machines with any number of cores, and nothing here
    is large enough to earn back what starting threads takes.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # else it opens the files of all installed packages
    gc.set_threshold(COLLECT_EVERY)
    atexit.register(gc.freeze)  # nor is anything looked for in what ends with the process
    invoke(group, "twin")


def invoke(command: click.Command, name: str) -> None:
    """Run a command; an expected failure is one line on stderr and exit code 1. Other signals end it like Ctrl-C."""
    handle_signals()
    open_streams()
    command_line()
    stdout = sys.stdout
    try:
        code = called(command, name)
        stdout.flush()
        if sys.stdout is not stdout:  # click itself has met a broken pipe, and put another stream there
            code = nobody_reads()
    except BrokenPipeError:
        code = nobody_reads()
    except Exception:
        if not is_interrupted():
            raise
        code = interrupted()  # what was interrupted may fail in any way
    end(code)


def interrupted() -> int:
    """Say that a signal has ended the command; its exit code."""
    with suppress(OSError):  # the terminal may be closed
        say("interrupted", err=True)
    return 130


def called(command: click.Command, name: str) -> int:
    """Run a command to its exit code."""
    try:
        refuse_bytes(sys.argv[1:])
        command(prog_name=name, standalone_mode=False)
    except SystemExit as ending:
        if not isinstance(ending.code, int):
            raise
        return ending.code
    except BrokenPipeError:  # before OSError, of which it is one
        raise
    except click.ClickException as error:
        error.__dict__["message"] = printable(error.message)
        error.show()
        return error.exit_code
    except (TwinError, OSError, MemoryError) as error:
        for line in told(error):
            say(f"error: {line}", err=True)
        return 1
    except (click.Abort, KeyboardInterrupt):  # before RuntimeError, of which the first is one
        return interrupted()
    except (ImportError, SystemError, RuntimeError) as error:  # the last: no memory for a thread
        if not memory_is_limited():
            raise
        say(f"error: {told(MemoryError(' '.join(str(error).split())[-120:]))[0]}", err=True)
        return 1
    return 0


def refuse_bytes(arguments: list[str]) -> None:
    """UsageError for an argument with bytes that are no text: recordings and reports could not name such a file."""
    for one in arguments:
        try:
            one.encode()
        except UnicodeEncodeError as error:
            byte = os.fsencode(one[error.start])[0]
            raise click.UsageError(
                f"{printable(one)}: byte 0x{byte:02x} is not UTF-8 text. Rename the file or folder."
            ) from None


def told(error: TwinError | OSError | MemoryError) -> list[str]:
    """An expected failure in lines."""
    if isinstance(error, TwinError):
        return str(error).split("\n")
    if isinstance(error, MemoryError):
        return [f"not enough memory{f' ({error})' if str(error) else ''}. Record less, or raise the limit (ulimit -v)."]
    if error.errno == errno.ENOMEM:
        return told(MemoryError())
    place = f"{error.filename}: " if error.filename else ""
    if error.errno == errno.ENOSPC:
        return [f"{place}the disk is full. Free some space; what was written before is kept."]
    return [f"{place}{error.strerror or error}. Check the path, its permissions and the disk."]
