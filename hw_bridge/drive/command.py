"""`twin drive`: a simulated drive as a process of its own, on any python-can interface."""

from __future__ import annotations

import signal
import struct
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.profiles import MODULES
from twin.errors import SimulationError

if TYPE_CHECKING:
    from types import FrameType

    import can

    from hw_bridge.profile import Profile

LISTENING = 0.5  # [s] how long another node may take to be heard
IDENTITY = ((0x1000, 0), (0x1018, 1), (0x1018, 2))  # what it is asked, and asked for in vain


@click.command("drive", short_help="a simulated CANopen drive on any CAN interface")
@click.option("--profile", "-p", "name", type=click.Choice(list(MODULES)), required=True, help="The vendor's drive.")
@click.option("--node", "-n", type=click.IntRange(1, 127), default=1, show_default=True, help="Its node-ID.")
@click.option("--interface", "-i", help="python-can's interface: socketcan, slcan, udp_multicast, ...")
@click.option("--channel", "-c", help="The interface's channel: can0, /dev/ttyACM0, 239.74.163.2, ...")
@click.option("--bitrate", type=int, default=1_000_000, show_default=True, help="For interfaces that have one.")
@click.option(
    "--eds", type=click.Path(dir_okay=False, path_type=Path), help="Object dictionary instead of the profile's."
)
@click.option(
    "--write-eds", type=click.Path(dir_okay=False, path_type=Path), help="Write the profile's EDS file and end."
)
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder for compiled objects.")  # fmt: skip
def command(
    name: str, node: int, interface: str | None, channel: str | None, bitrate: int, eds: Path | None,
    write_eds: Path | None, build: Path,
) -> None:  # fmt: skip
    """Run a simulated CANopen drive with its motor, paced by the wall clock, until Ctrl-C.

    It refuses to start where another node answers on its ID: a simulated drive does not belong on a real machine's bus.

    \b
    twin drive --profile epos4 --node 3 --interface socketcan --channel vcan0
    twin drive -p faulhaber_v3 -n 1 -i udp_multicast -c 239.74.163.2
    twin drive -p mclm --write-eds mclm.eds
    """
    from hw_bridge import eds as files
    from hw_bridge.profiles import profile

    chosen = profile(name)
    if write_eds is not None:
        write_eds.write_text(files.export(chosen))
        return
    if interface is None or channel is None:
        raise click.UsageError("Name --interface and --channel, such as -i socketcan -c vcan0, or use --write-eds.")
    if eds is not None:
        chosen = replace(chosen, objects=files.load(eds))
    serve(chosen, node, interface, channel, bitrate, build)


def serve(chosen: Profile, node: int, interface: str, channel: str, bitrate: int, build: Path) -> None:
    """Run the drive on an interface until a signal ends it."""
    import can

    from hw_bridge.drive.drive import Drive
    from hw_bridge.drive.motor import Motor
    from hw_bridge.wire import Wire

    drive = Drive(chosen, node, Motor(chosen.motor, build=build))
    try:
        bus = can.Bus(channel=channel, interface=interface, bitrate=bitrate)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise SimulationError(f"{interface} {channel}: cannot be opened: {error}. Check the adapter.") from error
    try:
        refuse_if_taken(bus, node)
        wire = Wire(drive, bus)
        _stop_on_signals(wire.stop)
        click.echo(f"{chosen.title}: node {node} on {interface} {channel}. Ctrl-C ends it.")
        wire.run()
        click.echo(
            f"stopped after {drive.port.agenda.now / 1e9:.1f} s, {wire.overruns} overruns, {wire.lost} frames lost"
        )
    finally:
        bus.shutdown()


def _stop_on_signals(stop: threading.Event) -> None:
    def handle(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, handle)
    signal.signal(signal.SIGTERM, handle)


def refuse_if_taken(bus: can.BusABC, node: int) -> None:
    """Listen, then ask for device type and identity; whoever is heard on this ID is another node."""
    import can

    own = {0x80 + node, 0x580 + node, 0x700 + node} | {0x180 + 0x100 * n + node for n in range(4)}
    for index, sub in IDENTITY:
        request = struct.pack("<BHB4x", 0x40, index, sub)
        bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
        until = time.monotonic() + LISTENING / len(IDENTITY)
        while (left := until - time.monotonic()) > 0:
            message = bus.recv(left)
            if message is not None and not message.is_extended_id and message.arbitration_id in own:
                raise SimulationError(
                    f"node {node}: another node answers on this ID ({_told(message)}). "
                    f"Choose another ID, or an interface without real drives."
                )


def _told(message: can.Message) -> str:
    return f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"


def main() -> None:
    """Run the command as `twin` would."""
    from twin.cli import invoke

    invoke(command, "python -m hw_bridge.drive")
