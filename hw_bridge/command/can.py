"""`twin can decode`: a trace with its meaning."""

from __future__ import annotations

import csv
import json
import sys
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.profiles import DRIVE_PROFILES
from twin.cli import say
from twin.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.profiles import Profile
    from hw_bridge.trace import DecodedFrame, Decoder

SERVICES = ("nmt", "sync", "emcy", "time", "pdo", "sdo", "heartbeat", "guard", "error", "other")


@click.group("can", short_help="decode CAN traces")
def command() -> None:
    """Decode CAN traces."""


@command.command("decode", short_help="print a trace with the meaning of its frames")
@click.argument("trace", type=click.Path(path_type=Path), metavar="TRACE")
@click.option("--bench", type=click.Path(path_type=Path), metavar="FILE", help="Hardware file that names the drives.")
@click.option(
    "--profile",
    "-p",
    "profiles",
    multiple=True,
    type=click.Choice(list(DRIVE_PROFILES)),
    help="A node's drive; repeat.",
)
@click.option(
    "--node",
    "-n",
    "nodes",
    multiple=True,
    type=click.IntRange(1, 127),
    help="The node of each --profile; without one, show these nodes only.",
)
@click.option(
    "--eds",
    "files",
    multiple=True,
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="A node's own objects, of any vendor; one for each --node.",
)
@click.option("--only", multiple=True, type=click.Choice(SERVICES), help="Show these services only; repeat.")
@click.option("--events", is_flag=True, help="Show only what is more than the daily exchange.")
@click.option(
    "--from", "begin", type=float, default=float("-inf"), metavar="S", help="Leave out what was before this time [s]."
)
@click.option("--to", "end", type=float, default=float("inf"), metavar="S", help="Leave out what was after it [s].")
@click.option("--json", "form", flag_value="json", help="One JSON object per line.")
@click.option("--csv", "form", flag_value="csv", help="One row per frame, values included.")
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write to this file."
)
def decode(
    trace: Path,
    bench: Path | None,
    profiles: tuple[str, ...],
    nodes: tuple[int, ...],
    files: tuple[Path, ...],
    only: tuple[str, ...],
    events: bool,
    begin: float,
    end: float,
    form: str | None,
    output: Path | None,
) -> None:
    """Print the frames of TRACE (.asc, .blf, .log) as candump does, with their meaning.

    PDO mappings and scaling follow the SDO traffic in the trace, from the profile's defaults on. A node whose identity
    is read in the trace needs no --profile.

    \b
    twin can decode run.blf --bench hw_bridge/benches/simulated_force.yaml
    twin can decode run.log --profile epos4 --node 3 --events
    twin can decode run.log --node 3 --eds drive.eds
    """
    if profiles and len(profiles) != len(nodes):
        raise click.UsageError("Name one --node for each --profile, in the same order.")
    if bench is not None and profiles:
        raise click.UsageError("Name a --bench or --profile, not both.")
    if files and len(files) != len(nodes):
        raise click.UsageError("Name one --node for each --eds, in the same order.")
    decoder = made(bench, profiles, nodes, files)
    shown = () if profiles or files else nodes
    lines = (
        line
        for line in decoded(trace, decoder)
        if begin <= line.time / 1e9 <= end
        and (line.notable or not events)
        and (not only or line.service.lower() in only)
        and (not shown or line.node in shown)
    )
    write = {None: text, "json": as_json, "csv": as_csv}[form]
    try:
        with output.open("w", encoding="utf-8") if output else nullcontext(sys.stdout) as file, redirect_stdout(file):
            write(lines)
    except BrokenPipeError:  # the reader, such as head, has seen enough
        sys.stderr.close()


def made(bench: Path | None, profiles: tuple[str, ...], nodes: tuple[int, ...], files: tuple[Path, ...]) -> Decoder:
    """Create a decoder for the command line's nodes."""
    from hw_bridge import eds
    from hw_bridge.hardware import load
    from hw_bridge.profiles import profile
    from hw_bridge.trace import Decoder, TracedNode

    objects = {node: eds.load(file) for node, file in zip(nodes, files, strict=False)}
    if bench is not None:
        return Decoder.of_bench(load(bench), objects=objects)
    chosen: dict[int, Profile | None] = dict.fromkeys(objects)
    chosen |= {node: profile(name) for name, node in zip(profiles, nodes, strict=False)}
    return Decoder(
        TracedNode(node, chosen_profile, objects=objects.get(node, ())) for node, chosen_profile in chosen.items()
    )


def decoded(trace: Path, decoder: Decoder) -> Iterator[DecodedFrame]:
    """Decode all frames of a trace."""
    from hw_bridge.wire import read

    last, earlier = None, 0
    for time, frame, why in read(trace):
        earlier += last is not None and time < last
        last = time
        yield decoder.decode(time, frame) if frame is not None else decoder.error(time, why)
    if earlier:
        say(f"note: {trace}: {earlier} frames are earlier than the one before them. Sort them by time.", err=True)


def text(lines: Iterator[DecodedFrame]) -> None:
    """Print frames as candump does, then their meaning."""
    for line in lines:
        say(format_line(line))


def format_line(line: DecodedFrame) -> str:
    """Format a frame as one line of text."""
    frame = line.frame
    if frame is None:
        raw = f"{'':3}  {'':3}  {'':23}"
    elif frame.remote:
        raw = f"{frame.id:03X}  [{frame.length}]  {'remote':23}"
    else:
        raw = f"{frame.id:03X}  [{len(frame.data)}]  {frame.data.hex(' ').upper():23}"
    return f"({line.time / 1e9:.6f})  {raw}  {line.service:9} {line.text}".rstrip()


def as_json(lines: Iterator[DecodedFrame]) -> None:
    """One object per line; values are in SI where a unit is known."""
    for line in lines:
        frame = line.frame
        say(
            json.dumps(
                {
                    "time": line.time / 1e9,
                    "id": frame.id if frame is not None else None,
                    "data": frame.data.hex() if frame is not None else None,
                    "node": line.node,
                    "service": line.service,
                    "text": line.text,
                    "values": line.values,
                    "event": line.notable,
                }
            )
        )


def as_csv(lines: Iterator[DecodedFrame]) -> None:
    """One row per frame; values as name=value."""
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["time [s]", "id", "data", "node", "service", "text", "values"])
    for line in lines:
        frame = line.frame
        rows.writerow(
            [
                f"{line.time / 1e9:.6f}",
                f"{frame.id:03X}" if frame is not None else "",
                frame.data.hex() if frame is not None else "",
                line.node,
                line.service,
                printable(line.text),
                " ".join(f"{key}={value}" for key, value in line.values.items()),
            ]
        )
