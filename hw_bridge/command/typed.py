"""Commands of `twin hil` run from pages: one at a time in a separate process.

Motion is monitored by that process: limits, ramps, dead-man and stop are those of the command. It receives the
renewals of the operator's page, and ends without them or this server. `--arm` comes from the server's own command line.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from hw_bridge.command.bench.motion import EXPIRED, READY
from hw_bridge.command.bench.single_axis import NOT_HOMED
from hw_bridge.command.commissioning_steps import FILE_INDEPENDENT
from hw_bridge.command.live_motion import LiveMotion
from hw_bridge.command.progress import STOPPED, StepProgress, outcome
from hw_bridge.command.state_watch import StateWatch
from hw_bridge.commission import ATTENDED, HOLD, axis
from hw_bridge.dictionary import State
from hw_bridge.hardware import load, resolve_bench
from hw_bridge.master import Reference
from twin.errors import TwinError
from twin.live import Channel, ClosedError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hw_bridge.command.commissioning_steps import Step
    from twin.console import Host

SHOWN = 100_000  # characters of what a command prints
HISTORY_LENGTH = 50  # commands that are listed
END_TIMEOUT = 15.0  # of a command after Ctrl-C: its stop, and restoration of the drive [s]
READS = frozenset({"scan", "status", "dump", "compare", "check"})  # beside a session and other programs too
LATE, LATE_SHOWN = 0.2, 5.0  # an answer of the page that is so old is late, and is shown for so long [s]
HOME = "home"
HOMED_AT = re.compile(r"(\S+ \S+) from reference")
IDENTITY = re.compile(r"node (\d+)(?: \([^)]*\))?: (?:(?!node \d).)*?serial ([0-9A-F]+)h")  # in what a command prints
MOVES = frozenset({"enable", HOME, "jog", "move", "direction", "step"})  # needs --arm for real drives, and a page


class Typed:
    """Runner of commands on the drives of a hardware file. Thread-safe; `changed` counts updates to show."""

    def __init__(self, console: Host) -> None:
        assert console.hardware is not None
        self.console, self.file = console, console.hardware
        self.content = ""  # hash of the hardware file and of its EDS files
        self.eds: list[str] = []  # paths of these
        self.exchanged: dict[str, str] = {}  # sentence about each drive in whose place another one answers
        self.file_problem = ""  # why the file cannot be used now; `keys` and `axes` are then those of before
        self.read_again = 0.0  # when a changed file was read [s since the epoch], or 0
        self._read_file()
        self.progress = StepProgress(console.runs / "commissioning" / "progress.json", self.scope)
        self.motion = LiveMotion()
        self.watch = StateWatch(self.file, console.build)  # only between commands: never two SDO clients of a node
        self.text = self.line = ""
        self.began = 0.0  # when the latest command began [s]
        self.word = self.node = ""  # of what goes on, or went last
        self.done: deque[tuple[float, str, int]] = deque(
            maxlen=HISTORY_LENGTH
        )  # when it began, what was typed, its exit code
        self.outputs: deque[str] = deque(maxlen=HISTORY_LENGTH)  # what each of `done` has printed
        self.changed = 0
        self.running = False
        self.process: subprocess.Popen[bytes] | None = None
        self.speed = (0.0, "")  # of a jog, as the page shows it
        self._page: Channel | None = None
        self._listener: threading.Thread | None = None
        self._held = (0.0, -math.inf)  # how far, renewed when
        self._late = (0.0, -math.inf)  # age of an answer of the page, and when it came
        self._lock = threading.Lock()
        self._stop_count = 0

    # --------------------------------------------------------------------------------------------------- what goes on

    @property
    def attended(self) -> bool:
        """Whether it needs a page."""
        return self.running and self._page is not None

    @property
    def busy(self) -> str:
        """Reason why no session may use the drives now, or an empty string."""
        alone = self.running and self.word not in READS
        return f"twin hil {self.word} has the drives (Commissioning). End it first." if alone else ""

    @property
    def controls(self) -> tuple[str, ...]:
        """The button of a jog, while the drive has said so and reports Operation enabled."""
        is_ready = self.word == "jog" and self.running and READY in self.text and self.motion.state == State.ENABLED
        return (f"jog {self.node}",) if is_ready else ()

    @property
    def lateness(self) -> float:
        """Greatest age of a recent answer of the operator's page [s]; 0 if none was late."""
        age, at = self._late
        return age if time.monotonic() - at < LATE_SHOWN else 0.0

    @property
    def late_text(self) -> str:
        """Why this page is too slow to move a drive: half of the time after which a motion ends; empty if it is not."""
        text = f"This page answers late ({self.lateness:.1f} s): too slow to move. Close other pages or use a terminal."
        return text if self.lateness > ATTENDED / 2 else ""

    @property
    def has_expired(self) -> bool:
        """Whether the dead-man switch of the running jog has ended its latest motion."""
        return self.running and self.text.rstrip().endswith(EXPIRED)

    @property
    def held(self) -> Mapping[str, float]:
        """Deflection of the button, while renewed."""
        at, renewed = (0.0, 0.0) if self.has_expired else self._held
        return dict.fromkeys(self.controls, at) if at and time.monotonic() - renewed < HOLD / 1e9 else {}

    def position(self, node: str) -> float | None:
        """Position of a drive from its reference as last read [m or rad], infinite if it is not homed, None if unknown."""
        text = next((value for title, value in self.watch.rows.get(node, []) if title.startswith("6064h")), "")
        if self.keys.simulated or self.axes[node].keys.homing is None or text.endswith(NOT_HOMED):
            return math.inf
        match = HOMED_AT.match(text)
        return self.axes[node].si(match[1], "position") if match else None

    def needs_arm(self, word: str) -> bool:
        """Whether a command may move real drives, and this server was started without --arm."""
        return word in MOVES and not self.console.arm and not self.keys.is_software()

    # ---------------------------------------------------------------------------------------------- the hardware file

    def _read_file(self) -> None:
        """Read the hardware file; TwinError if it is wrong."""
        self.content = digest(self.file, self.eds)
        keys = load(self.file)
        if (eds := [node.eds for node in keys.nodes.values() if node.eds]) != self.eds:
            self.eds, self.content = eds, digest(self.file, eds)
        self.axes = {name: axis(self.file, keys, name) for name in keys.nodes}
        self.keys = keys

    def reload(self) -> bool:
        """Read the hardware file again if its content has changed, unless a command runs; return whether it has.

        Also begin to read the live state where nothing speaks against it, and look at what it says of the drives.
        """
        is_due = self.watch.is_wanted and time.monotonic() > self.watch.retry_at
        if is_due and not (self.watch.is_on or self.running or self.keys.simulated):
            with suppress(TwinError):  # a session has the drives
                self.switch_watch(True)
        for name, rows in list(self.watch.rows.items()):
            if not self.running:
                self.motion.state = ""  # what the latest command printed of its drive is older
            for title, value in rows:
                if title.startswith("1018h"):
                    self._identify(name, value.removesuffix("h"))
        with self._lock:
            return not self.running and self._reload()

    def _reload(self) -> bool:
        if digest(self.file, self.eds) == self.content:
            return False
        self.file_problem, self.read_again = "", time.time()
        try:
            self._read_file()
        except TwinError as error:
            self.file_problem = str(error)
        self.progress.forget(scope=self.content)  # also if the file is again as it once was: the bus may not be
        self.watch.pause()  # its process has read the former file
        self.watch.resume()
        self.changed += 1
        return True

    def scope(self, step: Step, node: str) -> str:
        """What the success of a step depends on: the drive itself, or all of a bus; for most also the hardware file's content."""
        addresses = [self._address(name) for _, name, _ in self.keys.stations() if node in ("", name)]
        drives = "; ".join(f"{address} serial {self.progress.serials.get(address, '?')}" for address in addresses)
        return drives if step.word in FILE_INDEPENDENT else f"{self.content} {drives}"

    def _address(self, node: str) -> str:
        number = next((station.node for _, name, station in self.keys.stations() if name == node), 0)
        return f"{self.keys.interface} {self.keys.channel} node {number}"

    def _identify(self, node: str, serial: str) -> None:
        """Take the serial number of a drive as it was read: the steps of another drive are open."""
        if former := self.progress.learn_serial(self._address(node), serial):
            self.exchanged[node] = (
                f"Another drive answers: serial number {serial}h, before {former}h. Its steps are open: begin with check."
            )
            self.changed += 1

    # -------------------------------------------------------------------------------------------------------- begin

    def begin(
        self, word: str, node: str = "", options: Sequence[str] = (), speed: tuple[float, str] = (0.0, "")
    ) -> None:
        """Start a command; TwinError if another one runs, if the session uses the drives, if they are not armed, if the
        hardware file is not the one that the page shows, or if STOP was pressed while it waited for the live state to end.

        `speed`: of a jog with its unit, as shown on the page.
        """
        stop_count = self._stop_count
        with self.console.lock, self._lock:
            if self.running:
                raise TwinError(f"twin hil {self.word} goes on. End it first.")
            if word not in READS and (drives_in_use := self.console.drives_in_use):
                raise TwinError(drives_in_use)
            if self._reload():
                raise TwinError(f"{self.file} has changed and was read again. Look at its limits, then check it.")
            if self.file_problem:
                raise TwinError(self.file_problem)
            if word in MOVES and self.late_text:
                raise TwinError(self.late_text)
            if self.needs_arm(word):
                keys = self.keys
                raise TwinError(
                    f"{self.file}: {keys.interface} {keys.channel} may move real drives, and this console was not armed. "
                    f"End it, and start it with --arm."
                )
            words = [word, node, "-f", str(self.file)]
            words = [*filter(None, words), *options, *(["--arm"] if word in MOVES and self.console.arm else [])]
            self.watch.pause()
            if self._stop_count != stop_count:
                self.watch.resume()
                raise TwinError(f"twin hil {word}: stopped before it began.")
            self.line = shlex.join(["twin", "hil", *words])
            self.word, self.node, self.speed, self.text, self.began = word, node, speed, "", time.monotonic()
            self._held = (0.0, -math.inf)
            self.motion.begin()
            serial = self.progress.serials.get(self._address(node), "") if word in MOVES else ""
            same = [f"--serial={serial}"] if serial else []  # the command refuses another drive
            self._start([*words, *same, "--build", str(self.console.build)], word in MOVES)
            if self._stop_count != stop_count:  # meanwhile: there was no process yet
                self.stop()
            self.changed += 1

    def _start(self, words: list[str], attended: bool) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            fds = [theirs.fileno()] if attended else []
            self.process = subprocess.Popen(
                [sys.executable, "-c", "from twin.cli import main; main()", "hil", *words]
                + [f"--attended={descriptor}" for descriptor in fds],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=fds,
                start_new_session=True,  # Ctrl-C is for the server, which ends it
                env={**os.environ, "COLUMNS": "80", "PYTHONUNBUFFERED": "1"},
            )
        self.running, self._page = True, Channel(ours) if attended else None
        if not attended:
            ours.close()
        self._listener = threading.Thread(target=self._listen, args=[self.process, time.time()], daemon=True)
        self._listener.start()

    def _listen(self, process: subprocess.Popen[bytes], begin_time: float) -> None:
        """Collect its output until it ends."""
        assert process.stdout is not None
        while data := os.read(process.stdout.fileno(), 4096):
            text = data.decode(errors="replace")
            self.motion.process_output(text)
            self.text = settled(self.text + text)
            self.changed += 1
        process.stdout.close()
        if (code := process.wait()) == -signal.SIGINT:  # before it could handle the signal
            code, self.text = STOPPED, "interrupted before it began\n"
        if code < 0 or self.motion.state == State.ENABLED:  # it did not print how it left the drive
            self.motion.state = ""
        self.outputs.appendleft(self.text)
        self.done.appendleft((begin_time, self.line, code))
        names = {str(station.node): name for _, name, station in self.keys.stations()}
        for number, serial in IDENTITY.findall(" ".join(self.text.split())):
            if number in names:
                self._identify(names[number], serial)
        if (
            digest(self.file, self.eds) == self.content
        ):  # else the command may have read another file than the page shows
            result = outcome(self.word, code, self.text, self.motion.directions)
            self.progress.record(self.line, self.node, result)
        if self.word in MOVES and code and not Reference(self.keys, self.node).is_recorded:
            self.progress.forget(node=self.node, title=HOME)  # a motion that was cut short has lost the reference
        page, self._page = self._page, None
        if page is not None:
            page.end.close()
        with self._lock:
            self.running = False
            self.watch.resume()
        self.changed += 1

    def record(self) -> str:
        """Text of the commands that have ended, the first first: when each began, its command line, exit code and output."""
        commands = zip(reversed(list(self.done)), reversed(list(self.outputs)), strict=False)
        return "".join(
            f"{time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(begin_time))}  {line}  exit code {code}\n"
            f"{textwrap.indent(output.rstrip(), '    ')}\n"
            for (begin_time, line, code), output in commands
        )

    def switch_watch(self, is_on: bool) -> None:
        """Switch the live state on or off; TwinError while a session is open, and for drives that only exist in a command."""
        with self.console.lock, self._lock:
            if is_on and self.keys.simulated:
                raise TwinError(f"{self.file}: each command has a bus of its own, so nothing can be read between them.")
            if is_on and self.console.is_open:
                raise TwinError("a session is running. Stop it first.")
            self.watch.is_on = self.watch.is_wanted = is_on
            if not is_on:
                self.watch.pause()
            elif not self.running:
                self.watch.resume()

    # --------------------------------------------------------------------------------------------------- renew, end

    def _send_to_command(self, **message: float | bool) -> None:
        page = self._page
        if page is not None:
            with suppress(ClosedError):
                page.send(**message)

    def hold(self, name: str, at: float, press: int, age: float) -> None:
        """Renew the button of the running jog."""
        if name in self.controls:
            self._held = at, time.monotonic() - age
            self._send_to_command(here=time.monotonic() - age, hold=at, press=press)

    def here(self, age: float) -> None:
        """Renew the presence of the operator's page."""
        if age > max(LATE, self.lateness):
            self._late = age, time.monotonic()
        self._send_to_command(here=time.monotonic() - age)

    def release_hold(self) -> None:
        """Release the button."""
        self._held = (0.0, -math.inf)
        self._send_to_command(release_hold=True)

    def end(self) -> None:
        """End a jog or a held position in an orderly way, as `q` does."""
        self._send_to_command(end=True)

    def stop(self) -> None:
        """Stop at once, as Ctrl-C does."""
        self._stop_count += 1
        process = self.process
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGINT)

    def release_drives(self) -> None:
        """End the live state, and wait: a session begins."""
        self.watch.is_on = False
        self.watch.pause()

    def close(self) -> None:
        """Stop and wait; a command that does not end is killed: its drive misses the heartbeat and stops by itself."""
        self.stop()
        self.release_drives()
        if self.process is not None:
            try:
                self.process.wait(END_TIMEOUT)
            except subprocess.TimeoutExpired:
                self.process.kill()
            assert self._listener is not None
            self._listener.join(END_TIMEOUT)


def digest(file: Path, eds: Sequence[str] = ()) -> str:
    """Hash of the content of a hardware file and of its EDS files; those that cannot be read count as empty."""
    content = hashlib.sha256()
    for path in (file, *map(Path, eds)):
        with suppress(OSError, TwinError):
            content.update(hashlib.sha256(resolve_bench(path).read_bytes()).digest())
    return content.hexdigest()


def settled(text: str) -> str:
    """Text as a terminal would show it: without overwritten lines. A last "\\r" stays: what follows overwrites its line."""
    lines = [row.rstrip("\r").rpartition("\r")[2] for row in text.split("\n")]
    return "\n".join(lines)[-SHOWN:] + "\r" * text.endswith("\r")
