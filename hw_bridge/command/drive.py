"""`twin drive`: a simulated drive as a process of its own, on any python-can interface.

Over 400 lines: a third are the options of two commands.
"""

from __future__ import annotations

import os
import signal
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hw_bridge.bus import NEVER
from hw_bridge.dictionary import cia301, cia401
from hw_bridge.fault import LARGEST, MEANINGS, Cause, Fault
from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, GENERIC, MOTORS, device, profile
from twin.cli import say
from twin.cli.options import build_option
from twin.files import write_atomically
from twin.process import SIGNALS

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    from hw_bridge.device import Module, Slave, Switches
    from hw_bridge.profiles import Device, Profile


@click.group(
    "drive", invoke_without_command=True, short_help="simulate a CANopen drive or I/O module on any CAN interface"
)
@click.option(
    "--profile",
    "-p",
    "name",
    type=click.Choice([*DRIVE_PROFILES, *GENERIC, *DEVICES]),
    help="The vendor's drive, cia402: any drive by its --eds, or cia401: an I/O module.",
)
@click.option(
    "--node",
    "-n",
    type=click.IntRange(1, cia301.UNCONFIGURED),
    default=1,
    show_default=True,
    help="Its node-ID, 1 to 127; 255: none, it waits for one by LSS.",
)
@click.option("--interface", "-i", help="python-can's interface: socketcan, slcan, udp_multicast, ...")
@click.option("--channel", "-c", help="The interface's channel: can0, /dev/ttyACM0, 239.74.163.2, ...")
@click.option("--bitrate", type=int, default=1_000_000, show_default=True, help="For interfaces that have one.")
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar="NAME=VALUE",
    help="More arguments of the interface, such as port=43114; repeat.",
)
@click.option(
    "--eds", type=click.Path(dir_okay=False, path_type=Path), help="Object dictionary instead of the profile's."
)
@click.option(
    "--write-eds", type=click.Path(dir_okay=False, path_type=Path), help="Write the profile's EDS file and end."
)
@click.option(
    "--unit",
    "sizes",
    multiple=True,
    metavar="KIND=SIZE",
    help="With cia402: what a unit is that its EDS file does not tell, such as position='1 um'; repeat.",
)
@click.option("--motor", type=click.Choice(list(MOTORS)), help="The motor that it moves, and that it is set up for.")
@click.option(
    "--factory",
    is_flag=True,
    help="As delivered, not set up for its motor: an MCLM has a pitch of 18 mm and software limits of +-9 996 um.",
)
@click.option(
    "--store",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Keep there what 1010h stores, also after the process.",
)
@click.option(
    "--switch",
    "switches",
    multiple=True,
    metavar="NAME=PLACE",
    help="A switch, in the motor's coordinate, which is 0 "
    "where it stands at the start: negative=-35mm, positive=35mm (limit switches), home=4mm:6mm, probe1=..., probe2=... "
    "(where it is closed); repeat.",
)
@click.option(
    "--extrapolate",
    type=click.IntRange(0, 100),
    default=0,
    metavar="N",
    help="In csp, go on at the last speed for N periods of 60C2h when a target is late; then hold.",
)
@click.option(
    "--control",
    type=click.IntRange(0, 65535),
    metavar="PORT",
    help="Take faults of twin drive inject there; 0: any free port.",
)
@build_option
@click.pass_context
def command(
    context: click.Context,
    name: str | None,
    node: int,
    interface: str | None,
    channel: str | None,
    bitrate: int,
    options: tuple[str, ...],
    eds: Path | None,
    write_eds: Path | None,
    sizes: tuple[str, ...],
    motor: str | None,
    factory: bool,
    store: Path | None,
    switches: tuple[str, ...],
    extrapolate: int,
    control: int | None,
    build: Path,
) -> None:
    """Run a simulated CANopen drive with its motor, or an I/O module, paced by the wall clock, until Ctrl-C.

    It also ends when the process that started it ends, except under nohup. It refuses to start where another node answers on its ID: a simulated drive does not belong on a real machine's bus.

    \b
    twin drive --profile epos4 --node 3 --interface socketcan --channel vcan0
    twin drive -p faulhaber_v3 -n 1 -i udp_multicast -c 239.74.163.2
    twin drive -p cia401 -n 9 -i udp_multicast -c 239.74.163.2
    twin drive -p mclm --switch negative=-35mm --switch home=4mm:6mm
    twin drive -p mclm --write-eds mclm.eds
    """
    if context.invoked_subcommand is not None:
        return
    from hw_bridge import eds as files
    from hw_bridge.command.switches import parse_switches
    from hw_bridge.profiles import Profile

    if name is None:
        raise click.UsageError(f"Name --profile: {', '.join([*DRIVE_PROFILES, *GENERIC, *DEVICES])}.")
    chosen = select_device(name, eds, sizes)
    if 127 < node < cia301.UNCONFIGURED:
        raise click.UsageError(
            f"--node {node}: expected 1 to 127, or {cia301.UNCONFIGURED} for a device without a node-ID."
        )
    if switches and not isinstance(chosen, Profile):
        raise click.UsageError(f"--switch: {chosen.title} has no motor. Leave it out.")
    if write_eds is not None:
        write_atomically(write_eds, files.export(chosen))
        return
    if interface is None or channel is None:
        raise click.UsageError("Name --interface and --channel, such as -i socketcan -c vcan0, or use --write-eds.")
    if eds is not None and name not in GENERIC:
        chosen = with_dictionary(chosen, eds)
    if isinstance(chosen, Profile) and motor is not None:
        chosen = with_motor(chosen, motor)
    closing = parse_switches(switches, chosen.motor.unit) if isinstance(chosen, Profile) else None
    if extrapolate and isinstance(chosen, Profile):
        chosen = replace(chosen, extrapolation=extrapolate)
    is_set_up = not factory and (eds is None or motor is not None)
    serve(chosen, node, interface, channel, bitrate, build, control, store, named(options), is_set_up, closing)


def select_device(name: str, eds: Path | None, sizes: tuple[str, ...]) -> Profile | Device:
    """Select a drive or module by name; a generic drive by its EDS file."""
    if name in GENERIC:
        return generic_drive(name, eds, sizes)
    return profile(name) if name in DRIVE_PROFILES else device(name)


def with_dictionary(device: Profile | Device, path: Path) -> Profile | Device:
    """Replace a device's object dictionary by that of an EDS file; print warnings about differences."""
    from hw_bridge import eds as files
    from hw_bridge.profiles import Profile

    if isinstance(device, Profile):
        device, warnings = files.adopt(device, path)
    else:
        entries, warnings = files.merged(device, path)
        device = replace(device, objects=entries)
    for warning in warnings:
        say(f"warning: {warning}", err=True)
    return device


def with_motor(profile: Profile, motor: str) -> Profile:
    """Replace the motor of a drive's profile."""
    if profile.name in DRIVE_PROFILES and profile.name not in MOTORS[motor].scaling:
        raise click.UsageError(f"--motor {motor}: no values of it are known for {profile.title}.")
    return replace(profile, motor_name=motor)


def generic_drive(name: str, eds: Path | None, sizes: tuple[str, ...]) -> Profile:
    """Create a generic drive's profile from its EDS file, in the units of `--unit` where the file has none."""
    from pydantic import ValidationError

    from hw_bridge.dictionary import Dictionary
    from hw_bridge.eds import load_profile
    from hw_bridge.hardware import UnitKeys
    from hw_bridge.profiles import unknown_units

    if eds is None:
        raise click.UsageError(f"--profile {name}: name the drive's --eds FILE.")
    try:
        units = UnitKeys.model_validate({kind: size for kind, _, size in (text.partition("=") for text in sizes)})
    except ValidationError as error:
        raise click.UsageError(f"--unit: {error.errors()[0]['msg'].removeprefix('Value error, ')}.") from None
    profile = load_profile(name, str(eds), units.given)
    if missing := unknown_units(Dictionary(profile.objects, 1), units.given):
        raise click.UsageError(f"{'; '.join(missing)}. Add --unit, such as --unit velocity='1 mm/s'.")
    return profile


WIDTH = max(map(len, Cause))
TABLE = "\b\n" + "\n".join(f"{meaning:{WIDTH}}  {text}" for meaning, text in MEANINGS.items())


@command.command("inject", short_help="let a fault happen in a running twin drive", epilog=TABLE)
@click.argument("fault", type=click.Choice([str(cause) for cause in Cause]), metavar="FAULT")
@click.option("--control", type=click.IntRange(1, 65535), required=True, metavar="PORT", help="Its --control.")
@click.option("--code", metavar="HEX", default="0", help="EMCY code, such as 7300h, with emcy.")
@click.option("--lasting", is_flag=True, help="The error cannot be reset.")
@click.option(
    "--for",
    "duration",
    type=click.FloatRange(0),
    metavar="S",
    help="How long frames are disturbed [s]; else to the end.",
)
@click.option(
    "--share", type=click.FloatRange(0, 1, min_open=True), default=1.0, help="Share of the frames that is hit."
)
@click.option("--count", type=click.IntRange(1), help="So many frames at most.")
@click.option("--delay", type=click.FloatRange(0), default=0.01, metavar="S", help="With delay [s].", show_default=True)
@click.option("--jitter", type=click.FloatRange(0), default=0.0, metavar="S", help="Up to so much more [s].")
@click.option(
    "--factor", type=click.FloatRange(0), default=2.0, metavar="X", help="With friction, grip, slow.", show_default=True
)
@click.option("--offset", type=float, default=0.0, metavar="X", help="With encoder_offset [m or rad of the motor].")
@click.option("--identifiers", metavar="LOW-HIGH", help="With drop, delay, corrupt: these frames, such as 180h-1FFh.")
def inject_fault(
    fault: str,
    control: int,
    code: str,
    lasting: bool,
    duration: float | None,
    share: float,
    count: int | None,
    delay: float,
    jitter: float,
    factor: float,
    offset: float,
    identifiers: str | None,
) -> None:
    """Let FAULT happen in a simulated drive that was started with --control.

    \b
    twin drive --profile epos4 --node 3 -i socketcan -c vcan0 --control 4703
    twin drive inject emcy --code 7320h --control 4703
    twin drive inject heartbeat --for 0.5 --control 4703
    """
    from hw_bridge.command.control import request

    given = {"for": duration, "share": share, "delay": delay, "jitter": jitter, "factor": factor, "offset": offset}
    for name, value in given.items():
        if value is not None and not abs(value) <= LARGEST:  # not a number, too
            raise click.UsageError(f"--{name} {value}: expected a number of at most {LARGEST:g}.")
    try:
        number = int(code.removesuffix("h"), 16)
    except ValueError:
        raise click.UsageError(f"--code {code}: expected an EMCY code such as 7300h.") from None
    ends = None
    if identifiers is not None:
        try:
            low, high = (int(end.removesuffix("h"), 16) for end in identifiers.split("-"))
        except ValueError:
            raise click.UsageError(f"--identifiers {identifiers}: expected two such as 180h-1FFh.") from None
        ends = (low, high)
    request(
        control,
        Fault(
            Cause(fault),
            number,
            lasting,
            NEVER if duration is None else round(duration * 1e9),
            share,
            NEVER if count is None else count,
            round(delay * 1e9),
            round(jitter * 1e9),
            offset,
            factor,
            ends,
        ),
    )
    say(f"{fault}: {MEANINGS[Cause(fault)]}")


def named(options: tuple[str, ...]) -> dict[str, Any]:
    """Parse interface arguments by name, numbers as numbers."""
    arguments: dict[str, Any] = {}
    for option in options:
        name, mark, value = option.partition("=")
        if not (name and mark):
            raise click.UsageError(f"--option {option}: expected NAME=VALUE, such as port=43114.")
        arguments[name] = int(value) if value.lstrip("-").isdecimal() else value
    return arguments


def made(chosen: Profile | Device, node: int, build: Path) -> Slave:
    """Create the simulated device of a profile."""
    from hw_bridge.device import Drive, Module, Motor
    from hw_bridge.profiles import Profile

    if isinstance(chosen, Profile):
        return Drive(chosen, node, Motor(chosen.motor, build=build))
    return Module(chosen, node)


def serve(
    chosen: Profile | Device,
    node: int,
    interface: str,
    channel: str,
    bitrate: int,
    build: Path,
    port: int | None = None,
    store: Path | None = None,
    options: dict[str, Any] | None = None,
    is_set_up: bool = True,
    switches: Switches | None = None,
) -> None:
    """Run the drive on an interface until a signal ends it. `is_set_up`: it holds the values of its motor."""
    from hw_bridge.command.control import Control
    from hw_bridge.device import Drive, Module, Store
    from hw_bridge.plant import store_motor_parameters
    from hw_bridge.wire import Wire, assert_node_id_free, freeze_gc_and_set_fifo, link, open_bus, shut_down

    control: Control | None = None
    slave = made(chosen, node, build)
    if store is not None:
        slave.remember(Store(store, chosen.name, node))
    if isinstance(slave, Drive) and is_set_up:
        store_motor_parameters(slave, MOTORS[slave.profile.motor_name])
    if switches is not None and isinstance(slave, Drive):
        slave.axis.switches = switches
    bus = open_bus(interface, channel, bitrate, options or {})
    try:
        ends = link(bus, interface)
        if node != cia301.UNCONFIGURED:
            assert_node_id_free(ends, node)
        wire = Wire(slave, ends)
        if port is not None:
            control = Control(port, slave, wire)
            wire.look = control.look
        if isinstance(slave, Module):
            wire.look = switching(slave, wire.look)
        wire.look = ending_with_parent(wire.stop, wire.look)
        _stop_on_signals(wire.stop)
        freeze_gc_and_set_fifo()
        takes = f" Faults: --control {control.port}." if control is not None else ""
        label = f"node {node}" if node != cia301.UNCONFIGURED else "no node-ID"
        say(f"{chosen.title}: {label} on {interface} {channel}.{takes} Ctrl-C ends it.")
        wire.run()
        say(
            f"stopped after {slave.port.event_queue.now / 1e9:.1f} s, {wire.overruns} overruns, {wire.lost} frames lost"
        )
    finally:
        if control is not None:
            control.close()
        shut_down(bus)


def switching(module: Module, other: Callable[[], None]) -> Callable[[], None]:
    """Return a callback that prints each change of a module's outputs after calling `other`."""
    before = -1

    def look() -> None:
        nonlocal before
        other()
        if (now := module.outputs) != before:
            say(f"{module.port.event_queue.now / 1e9:.3f} s: outputs {now:0{2 * cia401.BYTES}X}h")
            before = now

    return look


def ending_with_parent(stop: threading.Event, other: Callable[[], None]) -> Callable[[], None]:
    """Return a look that also sets `stop` when the parent process has ended; under nohup the other look alone.

    Without it, a test or a script that is killed would leave its drives on the bus.
    """
    if getattr(signal, "SIGHUP", None) and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        return other
    parent = os.getppid()

    def look() -> None:
        other()
        if os.getppid() != parent:
            stop.set()

    return look


def _stop_on_signals(stop: threading.Event) -> None:
    def handle(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handle)


def main() -> None:
    """Run the command as `twin` would."""
    from twin.cli import invoke

    invoke(command, "python -m hw_bridge.drive")
