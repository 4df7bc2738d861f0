"""`twin cache`: show and clear the store of generated C, compiled code and FMUs in the build folder."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli.options import build_option
from twin.cli.terminal import say
from twin.store import CAPACITY, Store


@click.group("cache")
def command() -> None:
    """Show or clear the cache of generated C, compiled code and FMUs.

    \b
    twin cache path     its folder
    twin cache size     its entries, and how much they take
    twin cache clear    remove all entries; they are made again when needed

    The cache needs no care: an entry is used only if all that it was made from is unchanged, and a damaged entry is made again.
    """


@command.command("path")
@build_option
def path(build: Path) -> None:
    """Print the folder of the cache."""
    say(str(Store(build).folder))


@command.command("size")
@build_option
def size(build: Path) -> None:
    """Print the number of entries and their size.

    Above 500 MB the entries that were not used for the longest time are removed.
    """
    sizes = [size for _, size, _ in Store(build).entries()]
    say(f"{len(sizes)} entries, {sum(sizes) / 1e6:.1f} MB of at most {CAPACITY / 1e6:.0f} MB")


@command.command("clear")
@build_option
def clear(build: Path) -> None:
    """Remove all entries, and no other file. Other processes may go on using the cache."""
    sizes = [size for _, size, _ in Store(build).clear()]
    say(f"{len(sizes)} entries removed, {sum(sizes) / 1e6:.1f} MB")
