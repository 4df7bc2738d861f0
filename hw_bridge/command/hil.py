"""`twin hil`: what a person does with a bench before a run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.hardware import load
from hw_bridge.plant import bench_network
from hw_bridge.profiles import MODULES, UNFIT, identity, profile
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master import Master, ModuleNode, Node

TWICE = "answers to one question: several nodes have this ID"
KINDS = {401: "I/O module (CiA 401)", 402: "drive of an unknown vendor"}  # lower half of 1000h
QUESTION = 30_000_000  # how long a node has to answer during a scan [ns]


@click.group("hil", short_help="check a bench: scan, identify, compare with its hardware file")
def command() -> None:
    """Hardware in the loop: what is on the bus, and is it what the hardware file says."""


@command.command("check", short_help="scan a bus and say what differs from the hardware file")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder for compiled objects.")  # fmt: skip
def check(file: Path, build: Path) -> None:
    """Scan all node-IDs, identify each drive, compare with the hardware file. Nothing moves, nothing is written.

    Exit code 1 if anything differs.
    """
    keys = load(file)
    problems = differences(keys, build)
    for problem in problems:
        say(f"differs: {problem}")
    if problems:
        sys.exit(1)
    say("The bus is as the hardware file says.")


def differences(keys: HardwareKeys, build: Path) -> list[str]:
    """Everything on the bus that is not as the hardware file says."""
    from hw_bridge.master import Master

    master = Master(keys, bench_network(keys, build))
    try:
        master.wait(500_000_000)
        found = scan(master)
        for number, text in found.items():
            say(f"node {number}: {text}")
        expected = {station.number: station for station in master.stations.values()}
        problems = []
        for number, node in expected.items():
            if number not in found:
                problems.append(f"{node.name}: node {number} does not answer. Check its power and node-ID.")
            elif found[number].endswith(TWICE):
                problems.append(f"{node.name}: node {number}: {found[number]}. Give one of them another.")
            else:
                differing = master.compare(node)
                problems += differing or unready(node)
        strangers = [number for number in found if number not in expected]
        problems += [
            f"node {number} is not in the hardware file. Add it, or take it off the bus." for number in strangers
        ]
        return problems + ([master.rival.text] if master.rival.act else [])
    finally:
        master.network.close()


def unready(station: Node | ModuleNode) -> list[str]:
    """Why the right drive could not be run now; tells sizes that are not those of the profile."""
    from hw_bridge.master import Node, setup

    if not isinstance(station, Node):
        return []
    sizes, refused = setup.differing(station)
    for line in sizes:
        say(f"note: {line}")
    fault = setup.faults(station)
    return [*refused, *([fault] if fault else [])]


@command.command("reset", short_help="leave Fault, once the cause is known")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder for compiled objects.")  # fmt: skip
def reset(file: Path, build: Path) -> None:
    """Tell what each drive in Fault says (603Fh, 1003h), then reset it. Power stages stay off, nothing moves.

    A run never does this by itself. Exit code 1 if a drive is another one, or stays in Fault.
    """
    from hw_bridge.master import Master

    keys = load(file)
    master = Master(keys, bench_network(keys, build))
    try:
        master.wait(500_000_000)
        results = [reset_one(master, node) for node in master.nodes.values()]
    finally:
        master.network.close()
    if not all(results):
        sys.exit(1)


def reset_one(master: Master, node: Node) -> bool:
    """Reset one drive if it is the right one and in Fault; whether it is in none now."""
    from hw_bridge.dictionary import State
    from hw_bridge.master import setup

    try:
        if problems := master.compare(node):
            say(f"differs: {' '.join(problems)}")
            return False
        if not (fault := setup.faults(node)):
            say(f"{node.name}: is in no Fault.")
            return True
        state = setup.reset(node)
    except SimulationError as error:
        say(f"differs: {error}")
        return False
    say(f"{fault} Reset: {state}.{' Its cause is still there.' if state is State.FAULT else ''}")
    return state is not State.FAULT


def scan(master: Master) -> dict[int, str]:
    """Every node that answers, with what it is."""
    from hw_bridge.master import SdoClient, SilentError

    found = {}
    for number in range(1, 128):
        if number == master.keys.master:
            continue
        client = SdoClient(number, master.network.send, master.wait)
        with master.listening(client):
            try:
                client.attempts = 1
                device = client.number(0x1000, timeout=QUESTION)
                vendor, product, revision, serial = (client.number(0x1018, sub) for sub in (1, 2, 3, 4))
                master.wait(QUESTION)
            except SilentError:
                continue
            except SimulationError as error:
                found[number] = f"answers, but not as a CANopen device should: {error}"
                continue
        if len(client.answers) > 1:
            found[number] = f"{len(client.answers)} {TWICE}"
            continue
        name = known(vendor, product) or KINDS.get(device & 0xFFFF, f"device type {device:08X}h")
        found[number] = f"{name}, vendor {vendor:X}h, product {product:X}h, revision {revision:X}h, serial {serial:X}h"
    return found


def known(vendor: int, product: int) -> str:
    """The title of the profile with this identity; the vendor alone if the product is another one."""
    if (vendor, product) in UNFIT:
        return f"{UNFIT[vendor, product]}, which no profile fits"
    titles = []
    for name in MODULES:
        chosen = profile(name)
        own = identity(name)
        if own[1] == vendor:
            titles.append(chosen.title)
            if own[2] == product:
                return chosen.title
    return f"perhaps {' or '.join(titles)}" if titles else ""
