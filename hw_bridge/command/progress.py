"""StepProgress of a commissioning: which steps have succeeded with which hardware file, kept in a file over restarts."""

from __future__ import annotations

import json
import re
import time
from contextlib import suppress
from enum import Enum
from typing import TYPE_CHECKING

from hw_bridge.command.bench.single_axis import COMMAND_AFTER_STOP, STATE_AFTER_STOP
from hw_bridge.command.commissioning_steps import STEPS, is_step
from hw_bridge.commission import PAGE_SILENT
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Collection
    from pathlib import Path

    from hw_bridge.command.commissioning_steps import Step

BOTH = 2  # directions of a jog
STOPPED = 130  # exit code after Ctrl-C, which STOP and Esc send
WARNING = re.compile(r"^warning: ", re.MULTILINE)
LOST_PAGE = re.compile(
    rf"{re.escape(PAGE_SILENT)} for \d+ ms: stopped\.( \S+: power is off \((?!Fault).*)?\s*$"
)  # last, without a fault behind it


class Outcome(Enum):
    """What a command that has ended means for its step."""

    DONE = "done"
    FAILED = "failed"
    NEUTRAL = "neutral"  # neither: it was stopped, its page was lost, or a jog has not moved both ways


def outcome(word: str, code: int, text: str, directions: Collection[str]) -> Outcome:
    """Outcome of a command. A jog is done once it has moved in both directions and was ended in an orderly way."""
    if code == 0:
        return Outcome.NEUTRAL if word == "jog" and len(directions) < BOTH else Outcome.DONE
    return Outcome.NEUTRAL if code == STOPPED or has_lost_page(text) else Outcome.FAILED


def has_lost_page(text: str) -> bool:
    """Whether a command ended because its page was closed or silent, without a warning."""
    return not WARNING.search(text) and bool(LOST_PAGE.search(" ".join(text.split())))


def lines_after_stop(text: str) -> list[str]:
    """State and position in which a command has left its drive, then a line with the next steps; none without a stop."""
    if not (state := STATE_AFTER_STOP.search(text)):
        return []
    first = " ".join(state[1].split())
    commands = COMMAND_AFTER_STOP.findall(text)
    return [f"{first[0].upper()}{first[1:]}", f"{commands[0][0]} {', then '.join(word for _, word in commands)}."]


def labeled(text: str, label: str) -> list[str]:
    """Texts of the paragraphs with a label, such as "note": their further lines are indented."""
    return re.findall(rf"^{label}: (.*(?:\n  .*)*)", text, re.MULTILINE)


class StepProgress:
    """Steps that have succeeded, by scope (what they depend on), drive and title, with their time; and how they ended last.

    `serials`: serial number (1018h.4) of each drive as last read, by bus and node-ID. A file that cannot be read counts as
    empty: then the steps have to be done again.
    """

    def __init__(self, path: Path, scope: Callable[[Step, str], str]) -> None:
        self.path, self.scope = path, scope
        self.done: dict[tuple[str, str, str], float] = {}
        self.latest: dict[tuple[str, str, str], Outcome] = {}
        self.serials: dict[str, str] = {}
        with suppress(OSError, ValueError, TypeError, AttributeError, KeyError):
            saved = json.loads(path.read_text("utf-8"))
            self.serials = {str(address): str(serial) for address, serial in saved["serials"].items()}
            self.done = {(str(s), str(n), str(t)): float(at) for s, n, t, at in saved["done"]}

    def record(self, line: str, node: str, result: Outcome) -> None:
        """Record how a command line has ended; one that failed takes back an earlier success. Saves the file."""
        for step in STEPS:
            if not is_step(step, node, line):
                continue
            key = self._key(step, node)
            self.latest[key] = result
            if result is Outcome.DONE:
                self.done[key] = time.time()
            elif result is Outcome.FAILED:
                self.done.pop(key, None)
        self._save()

    def learn_serial(self, address: str, serial: str) -> str:
        """Save a drive's serial number; return the former one if it was another, else an empty string."""
        former = self.serials.get(address, serial)
        if self.serials.get(address) != serial:
            self.serials[address] = serial
            self._save()
        return former if former != serial else ""

    def forget(self, *, scope: str = "", node: str = "", title: str = "") -> None:
        """Take back all successes whose scope begins so, or that of a step of a drive. Saves the file."""
        self.done = {
            key: at
            for key, at in self.done.items()
            if not (scope and key[0].startswith(scope)) and key[1:] != (node, title)
        }
        self._save()

    def _save(self) -> None:
        with suppress(OSError):  # a full disk: the steps are known until the server ends
            rows = [[*key, at] for key, at in self.done.items()]
            write_atomically(self.path, json.dumps({"serials": self.serials, "done": rows}, indent=0))

    def time_of(self, step: Step, node: str) -> float | None:
        """When a step has succeeded [s since the epoch], or None."""
        return self.done.get(self._key(step, node))

    def latest_outcome(self, step: Step, node: str) -> Outcome | None:
        """How the latest attempt of a step since the server's start has ended."""
        return self.latest.get(self._key(step, node))

    def _key(self, step: Step, node: str) -> tuple[str, str, str]:
        name = "" if step.is_bus_wide else node
        return self.scope(step, name), name, step.title
