"""Client of a session: its state, and its commands."""

from __future__ import annotations

import atexit
import itertools
import os
import socket
import subprocess
import sys
import threading
import time as wall
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from twin.errors import SimulationError, TwinError
from twin.former import former_argument
from twin.live.catalog import Catalog
from twin.live.channel import Channel, ClosedError
from twin.live.operator.operation_log import NAME
from twin.live.recording_reader import RecordingReader, RefusedError, Samples

ANSWER_TIMEOUT = 30.0  # of a command, including one long step of a member [s]
STOP_TIMEOUT = 0.5  # of a stop command [s]: longer than any block
MESSAGE_CAPACITY = 50  # messages
OVER = ("stopped", "failed")


@dataclass(frozen=True)
class SessionState:
    """State of a session. Times in seconds; `lag`: behind the schedule; `jitter`: 99th percentile of the block starts' errors.

    `phase`: starting, running, paused, ended (by a member), finishing, stopped or failed.
    """

    phase: str = "starting"
    time: float = 0.0
    rate: float = 1.0
    achieved: float = 0.0
    lag: float = 0.0
    jitter: float = 0.0
    epoch: int = 0
    folder: str = ""
    held: Mapping[str, Any] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    overridden: Mapping[str, Any] = field(default_factory=dict)
    message: str = ""
    messages: tuple[tuple[int, float, str], ...] = ()
    hardware: dict[str, Any] | None = None


@dataclass(frozen=True)
class ExecutedCommand:
    """A command at its communication point [s], and its line in operated.yaml; `by_operator`: not an event of the scenario."""

    number: int
    time: float
    kind: str
    text: str
    line: str
    by_operator: bool = True


class LiveSession:
    """A scenario that runs in its own process. Thread-safe."""

    def __init__(self, process: subprocess.Popen[bytes], end: socket.socket, job: dict[str, Any]) -> None:
        self.process = process
        self.catalog: Catalog | None = None
        self.state = SessionState(rate=job["rate"])
        self.done: tuple[ExecutedCommand, ...] = ()
        self.changes: dict[int, Mapping[str, float]] = {}  # by epoch: first change of each variable by the operator [s]
        self._problems: list[str] = []
        self._ends = False  # whether SIGTERM was sent to the process
        self._said: deque[tuple[int, float, str]] = deque(maxlen=MESSAGE_CAPACITY)
        self._numbers = itertools.count(1)
        self._answers: dict[int, Future[str]] = {}
        self._lock = threading.Lock()
        self._changed = threading.Condition()
        self._reader: RecordingReader | None = None
        self._channel = Channel(end)
        self._send(**job)
        self._listener = threading.Thread(target=self._listen, name="live", daemon=True)
        self._listener.start()
        atexit.register(self.close)

    @classmethod
    def start(
        cls,
        scenario: Path | str,
        *,
        variant: str | None = None,
        seed: int | None = None,
        overrides: Sequence[str] = (),
        rate: float = 1.0,
        running: bool = False,
        hardware: Path | str | None = None,
        arm: bool = False,
        record: Sequence[str] = (),
        backend: str = "fmu",
        runs: Path | str = "runs",
        build: Path | str = "build",
        report: bool = False,
        values: Mapping[str, Any] = MappingProxyType({}),
        wait: bool = True,
        form: str | None = None,
    ) -> Self:
        """Start the process of the loop; with `wait` return when it is ready, TwinError if it fails.

        `record`: patterns in addition to the scenario's; `running`: not paused at the start; `values`: set at the start as by `set`; `hardware`, `arm`: as in `twin run`.
        """
        if os.name != "posix":
            raise TwinError(
                "live sessions need Linux or macOS, where a socket can be passed to a process. Use `twin run`."
            )
        ours, theirs = socket.socketpair()
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-m", "twin.live.worker", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C reaches the parent process, which ends this one
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )
        job = {
            "scenario": str(scenario),
            "variant": variant,
            "seed": seed,
            "overrides": list(overrides),
            "rate": rate,
            "running": running,
            "hardware": str(hardware) if hardware else None,
            "arm": arm,
            "record": list(record),
            "backend": former_argument("form", form, "backend", backend),
            "runs": str(runs),
            "build": str(build),
            "report": report,
            "values": dict(values),
        }
        live = cls(process, ours, job)
        if wait:
            live.wait()
        return live

    def wait(self, timeout: float | None = None) -> None:
        """Wait until the session is ready; TwinError if it fails."""
        with self._changed:
            self._changed.wait_for(lambda: self.catalog is not None or self.state.phase in OVER, timeout)
        if self.catalog is None:
            if self.state.phase in OVER:
                self.close()
            raise TwinError(self._problems or ["the session is not ready yet."])

    # ---------------------------------------------------------------------------------------------------- receiving

    def _listen(self) -> None:
        try:
            while True:
                for message in self._channel.receive(None):
                    with self._changed:
                        for kind, content in message.items():
                            if kind in MESSAGE_HANDLERS:
                                MESSAGE_HANDLERS[kind](self, content, message)
                        self._changed.notify_all()
        except ClosedError:
            self._gone()

    def _gone(self) -> None:
        code = self.process.wait()
        self._channel.end.close()
        with self._changed:
            if self.state.phase != "failed":
                self.state = replace(self.state, phase="stopped", achieved=0.0, lag=0.0, held={})
            if code and not self._problems and not self._ends:
                how = f"signal {-code}" if code < 0 else f"code {code}"
                text = f"the process of the loop has died ({how})."
                if self.state.folder:
                    text += f" Recover its results with: twin recover {self.state.folder}"
                self._problems = [text]
                self._say([len(self._said) + 1, wall.time(), text])
                self.state = replace(self.state, phase="failed")
            for answer in list(self._answers.values()):
                answer.set_result("the session is over.")
            self._answers.clear()
            self._changed.notify_all()

    def _receive_state(self, data: dict[str, Any], message: dict[str, Any]) -> None:
        self.changes[message.get("epoch", self.state.epoch)] = data.pop("changes", {})
        self.state = replace(self.state, **data)

    def _receive_catalog(self, data: dict[str, Any], message: dict[str, Any]) -> None:
        self.catalog, self.done = Catalog.of(data), ()
        self.state = replace(self.state, folder=message["folder"], epoch=message["epoch"], message="")

    def _receive_done(self, entries: list[dict[str, Any]], _message: dict[str, Any]) -> None:
        self.done = (*self.done, *(ExecutedCommand(**entry) for entry in entries))

    def _say(self, entry: Sequence[Any], _message: dict[str, Any] | None = None) -> None:
        number, instant, text = entry
        if text:
            self._said.append((number, instant, text))
        self.state = replace(self.state, message=text, messages=tuple(self._said))

    def _receive_progress(self, text: str, _message: dict[str, Any]) -> None:
        self.state = replace(self.state, message=text)

    def _receive_phase(self, phase: str, _message: dict[str, Any]) -> None:
        self.state = replace(self.state, phase=phase)

    def _receive_hardware(self, status: dict[str, Any], _message: dict[str, Any]) -> None:
        self.state = replace(self.state, hardware=status)

    def _receive_failed(self, problems: list[str], _message: dict[str, Any]) -> None:
        self._problems = problems
        self.state = replace(self.state, phase="failed", message=problems[0] if problems else "")

    def _receive_answer(self, number: int, message: dict[str, Any]) -> None:
        if (waiting := self._answers.pop(number, None)) is not None:
            waiting.set_result(message.get("refused", ""))

    # ------------------------------------------------------------------------------------------------------ reading

    def reader(self) -> RecordingReader:
        """Return the reader of the present run; RefusedError before the first."""
        with self._lock:
            folder, epoch = self.state.folder, self.state.epoch
            if not folder:
                raise RefusedError("nothing is recorded yet.")
            if self._reader is None or self._reader.epoch != epoch:
                if self._reader is not None:
                    self._reader.close()
                self._reader = RecordingReader(Path(folder), epoch)
            return self._reader

    def read(self, names: Sequence[str], since: float | None = None, until: float | None = None) -> Samples:
        """Return rows with since < time <= until [s], available 30 ms after their step. RefusedError if not recorded."""
        return self.reader().read(names, since, until)

    def latest(self, names: Sequence[str]) -> Samples:
        """Return the last row; none before the first."""
        return self.reader().latest(names)

    def scenario_text(self) -> str:
        """Return operated.yaml so far: a scenario that repeats all commands."""
        return (Path(self.state.folder) / NAME).read_text(encoding="utf-8")

    # ------------------------------------------------------------------------------------------------------- commands

    def _send(self, **message: Any) -> None:
        with self._lock, suppress(ClosedError):
            self._channel.send(**message)

    def _request(self, kind: str, timeout: float | None = ANSWER_TIMEOUT, **more: Any) -> None:
        """Send a command and wait for the answer; RefusedError with the reason of a refusal."""
        number, answer = next(self._numbers), Future[str]()
        self._answers[number] = answer
        if self.state.phase in OVER and self.process.poll() is not None:
            self._answers.pop(number, None)
            raise RefusedError(f"{kind}: the session is over.")
        self._send(ask=kind, number=number, **more)
        try:
            refused = answer.result(timeout)
        except FutureTimeoutError:
            raise SimulationError(
                f"{kind}: the loop has not answered for {timeout:g} s: one step takes long."
            ) from None
        if refused:
            raise RefusedError(refused)

    def resume(self) -> None:
        """Continue the simulation."""
        self._request("resume")

    def pause(self) -> None:
        """Pause the simulation."""
        self._request("pause")

    def step(self, count: int = 1) -> None:
        """Advance some communication steps and pause."""
        self._request("step", count=count)

    def step_macro(self, count: int = 1) -> None:
        """Advance to the next communication point of the slowest member and pause."""
        self._request("step", count=count, macro=True)

    def pace(self, rate: float) -> None:
        """Set the ratio of simulated to wall-clock time: 0.1 to 10, or inf; at most 1 for a scenario with controls."""
        self._request("pace", rate=rate)

    def reset(self, values: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Restart paused from the beginning, in a new folder, with `values` as by `set`; the folder of the run before is completed."""
        before = self.state.epoch
        self._request("reset", values=dict(values))
        with self._changed:
            self._changed.wait_for(lambda: self.state.epoch > before or self.state.phase == "failed")
        if self.state.epoch == before:
            raise TwinError(self._problems or ["reset: failed."])

    @property
    def changed_values(self) -> dict[str, Any]:
        """Parameters and inputs without a control that the operator has set in this run, other than they begin."""
        catalog, values = self.catalog, self.state.values
        if catalog is None:
            return {}
        sets = (each.text.removeprefix("set ") for each in self.done if each.by_operator and each.kind == "set")
        companions = {name for control in catalog.controls for name in control.along}
        changed = {}
        for name in dict.fromkeys(text.partition(" = ")[0] for text in sets):
            signal = catalog.signals.get(name.partition("[")[0])
            if signal is not None and signal.settable and name in values and name not in companions:
                changed[name] = values[name]
        return {
            name: value for name, value in changed.items() if value != getattr(catalog.signals.get(name), "start", None)
        }

    def set(self, name: str, value: Any) -> None:
        """Set a tunable parameter, or a free input without a control."""
        self._request("set", name=name, value=value)

    def override(self, name: str, value: Any) -> None:
        """Replace an output or input by this value for all readers."""
        self._request("override", name=name, value=value)

    def release(self, name: str) -> None:
        """End an override."""
        self._request("release", name=name)

    def trigger(self, key: str) -> None:
        """Apply an event of the catalog now."""
        self._request("trigger", key=key)

    def hold(self, name: str, value: Any, press: int, age: float = 0.0) -> None:
        """Renew a hold, `age` [s] ago; the input goes to rest unless this is repeated within `HOLD`, without drives `SIMULATED_HOLD`.

        Does not wait. `press`: increases with each new press. Refusals appear in `state.messages`.
        """
        self._send(ask="hold", name=name, value=value, press=press, instant=wall.monotonic() - age)

    def release_hold(self, name: str = "") -> None:
        """Move one input, or all, to rest. Does not wait."""
        self._send(ask="release_hold", name=name)

    def stop(self) -> Path:
        """End the session, drives by their stop sequence, and complete its folder; TwinError if it failed."""
        if self.process.poll() is None:
            try:
                self._request("stop", STOP_TIMEOUT)
            except SimulationError:  # busy with a build, a start of drives or a long step: SIGTERM has the same effect
                self._ends = True
                self.process.terminate()
            except RefusedError:
                pass
            with self._changed:
                if self.state.phase not in OVER:
                    self.state = replace(self.state, phase="finishing")
        self.process.wait()
        self._listener.join()
        atexit.unregister(self.close)
        if self._problems:
            raise TwinError(self._problems)
        return Path(self.state.folder)

    def close(self) -> None:
        """End the session without an error. Safe to call twice."""
        with suppress(TwinError):
            self.stop()
        if self._reader is not None:
            self._reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


MESSAGE_HANDLERS: dict[str, Callable[[LiveSession, Any, dict[str, Any]], object]] = {
    "state": LiveSession._receive_state,
    "catalog": LiveSession._receive_catalog,
    "done": LiveSession._receive_done,
    "said": LiveSession._say,
    "progress": LiveSession._receive_progress,
    "phase": LiveSession._receive_phase,
    "hardware": LiveSession._receive_hardware,
    "failed": LiveSession._receive_failed,
    "answer": LiveSession._receive_answer,
}
