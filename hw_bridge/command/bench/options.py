"""Options of every command of `twin hil`: the bus, and the hardware file that names it."""

from __future__ import annotations

import functools
import re
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from hw_bridge.commission import node_number
from hw_bridge.hardware import HardwareKeys, load
from hw_bridge.profiles import DRIVE_PROFILES
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hw_bridge.bus import Network
    from hw_bridge.commission import SdoSession
    from hw_bridge.hardware import ModuleKeys, NodeKeys
    from hw_bridge.master import Station

WIDTH = 80  # columns of a terminal
LABEL = re.compile(r"(note|differs|warning|refused|not restored): ")  # of a paragraph whose further lines are indented
REMEDY = re.compile(  # commands in messages of packages that do not hold the command line
    r"twin hil (?:disable|restore|store|dump|(?P<moves>jog)) \w++(?! -)|twin hil set \w++ [\w.]++ (?:'[^']*'|\w++)(?! -)"
)
PLACEHOLDER = re.compile(r"(?<= -f )FILE\b")
LAST, NARROWEST = 24, 12  # least columns of the last column, and of others that are wrapped


class OptionError(click.UsageError):
    """Missing or contradicting options: an error in one line, exit code 2."""

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - click's
        """Print the error."""
        for line in f"error: {self.format_message()}".split("\n"):  # wrapped by the caller
            say(line, err=True)


@dataclass(frozen=True)
class BusChoice:
    """The bus of a command line, by a hardware file or by an interface."""

    hardware: Path | None
    interface: str | None = None
    channel: str | None = None
    bit_rate: int = 0
    options: dict[str, Any] = field(default_factory=dict)
    trace: Path | None = None
    build: Path = Path("build")

    @functools.cached_property
    def keys(self) -> HardwareKeys | None:
        """The hardware file, if one is named."""
        return load(self.hardware) if self.hardware is not None else None

    @property
    def stations(self) -> dict[str, NodeKeys | ModuleKeys]:
        """Drives and modules of the hardware file by name, none without one."""
        return {name: station for _, name, station in self.keys.stations()} if self.keys is not None else {}

    @property
    def is_software(self) -> bool:
        """Whether nothing real can move or switch."""
        return (self.keys or self._named).is_software()

    @property
    def journals(self) -> Path:
        """The folder with the journals and dumps of the bus's drives."""
        from hw_bridge.journal import bus_folder
        from hw_bridge.master import restoration

        if self.keys is not None:
            return restoration.folder_of(self.keys)
        named = self._named
        return bus_folder(named.interface, named.channel, named.is_software(), self.options)

    @property
    def _named(self) -> HardwareKeys:
        """The bus that options name, without a file."""
        return HardwareKeys.model_construct(interface=self.interface or "", channel=self.channel or "")

    def complete(self, text: str) -> str:
        """Add the bus to the commands that a message names, so that they run as they are printed."""
        bus = f"-f {self.hardware}" if self.hardware is not None else f"-i {self.interface} -c {self.channel}"
        arm = "" if self.is_software else " --arm"
        text = REMEDY.sub(lambda match: f"{match[0]} {bus}{arm if match['moves'] else ''}", text)
        return PLACEHOLDER.sub(str(self.hardware), text) if self.hardware is not None else text

    @contextmanager
    def network(self) -> Iterator[Network]:
        """Open the bus, and close it at the end; --trace records all frames."""
        from hw_bridge.plant import bench_network
        from hw_bridge.wire import TraceWriter, WireNetwork

        if self.hardware is None and not (self.interface and self.channel):
            raise OptionError("Which bus? Name --hardware FILE, or -i and -c, such as -i socketcan -c can0.")
        if self.hardware is not None and (self.interface or self.channel):
            raise OptionError("Name --hardware or -i and -c, not both: the file has its own bus.")
        if self.keys is not None:
            network = bench_network(self.keys, self.build)
        else:
            network = WireNetwork(self.interface or "", self.channel or "", self.bit_rate, self.options)
        writer = None
        try:
            if self.trace is not None:
                writer = TraceWriter(self.trace, self.channel or "can", network.wall_clock)
                network.observe(writer.write)
            yield network
        finally:
            network.close()
            for text in network.observer_errors:
                paragraph(f"warning: {text}")
            if writer is not None and (problem := writer.close()):
                paragraph(f"warning: {problem}")

    @contextmanager
    def sdo_session(self) -> Iterator[SdoSession]:
        """Open an SDO session on the bus."""
        from hw_bridge.commission import BOOT, SdoSession

        with self.network() as network:
            sdo_session = SdoSession(network, self.stations)
            if not network.wall_clock:  # its drives are switched on with the bus
                sdo_session.wait(BOOT)
            yield sdo_session


def note_leftovers(bus: BusChoice, station: Station, indent: int = 0) -> set[str]:
    """Print a note on the objects that a killed run wrote and that are not restored; return their names, such as 6085h.0."""
    from hw_bridge.commission import nvm

    if bus.keys is not None and bus.keys.simulated:  # its drives are new ones
        return set()
    try:
        left = nvm.unrestored_objects(station, bus.journals)
    except SimulationError as error:  # it is damaged, or a running program holds it
        paragraph(f"note: {error}", indent)
        return set()
    if left:
        paragraph(f"note: {bus.complete(nvm.unrestored_text(station, left))}", indent)
    return {change.name for change in left}


BUS = (
    click.option(
        "--hardware",
        "-f",
        type=click.Path(path_type=Path),
        metavar="FILE",
        envvar="TWIN_HARDWARE",
        show_envvar=True,
        help="Hardware file that names the bus and its nodes.",
    ),
    click.option(
        "--interface", "-i", help="Instead of -f: python-can's interface: socketcan, slcan, pcan, udp_multicast, ..."
    ),
    click.option(
        "--channel", "-c", help="Channel of the interface: can0, /dev/ttyACM0, PCAN_USBBUS1, 239.74.163.2, ..."
    ),
    click.option(
        "--bitrate",
        type=int,
        default=1_000_000,
        show_default=True,
        help="Bit rate [bit/s] of interfaces that have one.",
    ),
    click.option(
        "--option",
        "options",
        multiple=True,
        metavar="NAME=VALUE",
        help="Further argument of the interface. Repeatable.",
    ),
    click.option(
        "--trace",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help="Record every frame sent or received (.blf, .asc, .log).",
    ),
    click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), hidden=True),
)
PROFILE = click.option(
    "--profile",
    "-p",
    "profile",
    type=click.Choice(list(DRIVE_PROFILES)),
    help="Drive profile.  [default: by the identity that the drive reports]",
)
NODE = click.argument("node", metavar="NODE")


def on_a_bus(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of the bus, passed as one `bus`."""

    @functools.wraps(function)
    def wrapped(
        hardware: Path | None,
        interface: str | None,
        channel: str | None,
        bitrate: int,
        options: tuple[str, ...],
        trace: Path | None,
        build: Path,
        **others: Any,
    ) -> Any:
        from hw_bridge.command.drive import named

        from_environment = click.get_current_context().get_parameter_source("hardware") is ParameterSource.ENVIRONMENT
        if from_environment and interface:  # what is typed counts
            hardware = None
        bus = BusChoice(hardware, interface, channel, bitrate, named(options), trace, build)
        try:
            if isinstance(node := others.get("node"), str):  # before the bus is opened
                node_number(node, bus.stations)
            return function(bus, **others)
        except SimulationError as error:
            raise SimulationError(bus.complete(str(error))) from error

    for option in reversed(BUS):
        wrapped = option(wrapped)
    return wrapped


def table(rows: Sequence[Sequence[str]], indent: int = 0, head: bool = False) -> None:
    """Print rows in columns no wider than the terminal: the last one is wrapped, and others where it would have no room."""
    import textwrap
    from itertools import zip_longest

    if not rows:
        return
    widths = [max(1, *(len(row[column]) for row in rows)) for column in range(len(rows[0]) - 1)]
    while WIDTH - indent - sum(widths) - 2 * len(widths) < LAST and max(widths) > NARROWEST:
        widths[widths.index(max(widths))] -= 1
    widths.append(max(WIDTH - indent - sum(widths) - 2 * len(widths), LAST))
    for number, row in enumerate(rows):
        cells = [textwrap.wrap(cell, width) for cell, width in zip(row, widths, strict=True)]
        for words in list(zip_longest(*cells, fillvalue="")) or [("",)]:
            line = "  ".join(f"{text:<{width}}" for text, width in zip(words, widths, strict=False))
            say((" " * indent + line).rstrip())
        if head and not number:
            say(" " * indent + "-" * (WIDTH - indent))


def paragraph(text: str, indent: int = 0) -> None:
    """Print a text wrapped at the terminal's width; further lines of a note or a difference are indented, so that a page finds its end."""
    import textwrap

    further = "  " if LABEL.match(text) else ""
    for line in textwrap.wrap(
        text, WIDTH - indent, subsequent_indent=further, break_on_hyphens=False, break_long_words=False
    ):
        say(" " * indent + line)
