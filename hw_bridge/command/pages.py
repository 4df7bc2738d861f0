"""Commissioning in the console: what only reads a drive, as buttons of the same commands that one types.

They run in a process of their own, over the bus and by SDO only, beside the session; what they print is shown. What moves or
changes a drive needs the bus alone and a dead-man key: it is typed, and shown here where the command line has armed the drives.
"""

from __future__ import annotations

import asyncio
import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hw_bridge.hardware import load
from twin.console import Panel

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.console import Host

LONGEST = 60.0  # of a command [s]
SHOWN = 20_000  # characters of what it prints
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")  # of a node
TYPED = ("reset", "enable", "direction", "jog", "home", "move", "step", "disable")


def fill(console: Host, may: Callable[[], bool]) -> None:
    """The panel: scan the bus; of each node its status, a dump, and what differs from that."""
    from nicegui import ui

    file, live = console.hardware, console.live
    if file is None or live is None:
        return
    keys = load(file)
    nodes = [name for _, name, _ in keys.stations() if NAME.fullmatch(name)]
    if keys.simulated:
        ui.label("Simulated in this run: these commands see drives that are switched on anew.").classes("twin-soft")
    else:
        ui.label("Read by SDO, beside the session.").classes("twin-soft")

    async def run(*words: str) -> None:
        if not may():
            ui.notify("This page watches: another one operates.", type="warning")
            return
        shown.text = f"twin hil {' '.join(words)} ..."
        shown.text = await said([*words, "-f", str(file), "--build", str(console.build)])

    with ui.row().classes("items-center full-width gap-1"):
        ui.button("scan", on_click=lambda: run("scan")).props("dense no-caps outline")
    for node in nodes:
        dump = Path(live.state.folder) / f"{node}.dcf"
        with ui.row().classes("items-center full-width gap-1"):
            ui.label(node).classes("col ellipsis")
            ui.button("status", on_click=lambda one=node: run("status", one)).props("dense no-caps flat")
            ui.button("dump", on_click=lambda one=node, to=dump: run("dump", one, str(to))).props("dense no-caps flat")
            ui.button("compare", on_click=lambda one=node, to=dump: run("compare", one, str(to))).props(
                "dense no-caps flat"
            ).tooltip("with what was dumped")
    shown = ui.label("").classes("twin-told")
    if console.arm:
        ui.label("Motion needs the bus alone and a key that is held: end the session, then type").classes("twin-soft")
        for word in TYPED:
            ui.label(f"twin hil {word} {nodes[0] if nodes else 'NODE'} -f {file}").classes("twin-told")


async def said(words: list[str]) -> str:
    """What a command of `twin hil` prints."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", "from twin.cli import main; main()", "hil", *words,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
        env={**os.environ, "COLUMNS": "80"},
    )  # fmt: skip
    try:
        text, _ = await asyncio.wait_for(process.communicate(), LONGEST)
    except TimeoutError:
        process.terminate()
        return f"twin hil {words[0]}: has not ended within {LONGEST:g} s."
    return text.decode(errors="replace")[:SHOWN]


PANEL = Panel("Commissioning", fill, hardware=True)
