"""`twin hil lss`: node-ID and bit rate of a device that has none, or the same as another."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import OptionError, on_a_bus, paragraph
from twin.cli import say

if TYPE_CHECKING:
    from hw_bridge.command.bench.options import BusChoice


class Number(click.ParamType):  # type: ignore[type-arg]
    """A number as data sheets print it: 11601, 0x2D51 or 2D51h."""

    name = "number"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number, or the usage error that says what is expected."""
        text = str(value)
        try:
            return int(text[:-1], 16) if text.endswith("h") else int(text, 0)
        except ValueError:
            return self.fail(f"expected a number such as 11601, 0x2D51 or 2D51h, not {text!r}.", param, ctx)


NUMBER = Number()


@click.command("lss")
@click.option("--vendor", type=NUMBER, metavar="N", help="Vendor-ID of the device (1018h.1), shown by scan.")
@click.option("--product", type=NUMBER, metavar="N", help="Product code (1018h.2).")
@click.option("--revision", type=NUMBER, metavar="N", help="Revision number (1018h.3).")
@click.option("--serial", type=NUMBER, metavar="N", help="Serial number (1018h.4), also on the label.")
@click.option("--node-id", type=click.IntRange(1, 127), metavar="ID", help="New node-ID.")
@click.option("--new-bitrate", type=int, metavar="B", help="New bit rate [bit/s]; takes effect at the next power-on.")
@on_a_bus
def lss_command(
    bus: BusChoice,
    vendor: int | None,
    product: int | None,
    revision: int | None,
    serial: int | None,
    node_id: int | None,
    new_bitrate: int | None,
) -> None:
    """Set node-ID or bit rate of a device by its identity (CiA 305), and store it. Without either: show the identity.

    Give all four of --vendor, --product, --revision and --serial, or none of them if the device is alone on the bus. New
    drives have the same node-ID: connect one, change its node-ID, then connect the next.

    \b
    twin hil lss -i socketcan -c can0
    twin hil lss --node-id 5 -i socketcan -c can0
    """
    from hw_bridge.commission import lss

    parts = (vendor, product, revision, serial)
    given = [part for part in parts if part is not None]
    if given and len(given) < len(parts):
        raise OptionError("Name all of --vendor, --product, --revision and --serial, or none if it is alone.")
    with bus.sdo_session() as sdo_session:
        identity, before = lss.configure(sdo_session, lss.Identity(*given) if given else None, node_id, new_bitrate)
        paragraph(f"{identity}: node {before}.")
        if node_id is not None and node_id not in sdo_session.states:
            paragraph(
                f"It did not tell that it started as node {node_id}. Switch it off and on, then look with twin hil scan."
            )
            sys.exit(1)
        if node_id is not None:
            say(f"It is node {node_id} now, and stays so.")
        if new_bitrate is not None:
            paragraph(
                f"It has {new_bitrate} bit/s once it is switched off and on. Change the others and --bitrate with it."
            )
