"""Web socket of a page: state of the session thirty times a second, and held controls in return.

A page answers each tick with the held controls and the number of the tick, from which the server knows the age of a hold,
including network delays. Messages are not trusted: see `PageMessages`. To the page:

    {"tick", "stop", "phase", "time", "rate", "achieved", "lag", "epoch", "operator", "watching", "held", "values", "message",
     "run": its number, after whose change no earlier value is valid; "dropped": the server has dropped this page, which reloads itself,
     "space": what moves in the shown scene in three dimensions, when it has changed}

From the page, one of these, up to MAX_CHARACTERS characters:

    {"watch": [name, ...]}                            send the values of these signals in SI, each when it has changed
    {"space": number of a scene, or null}             send what moves in a scene in three dimensions
    {"hold": control, "at": -1 to 1, "press": number of the press, "tick": the latest}     operator only
    {"release_hold": control, or "" for all}          operator only
    {"here": true, "tick": the latest}                operator only: the page shows motion outside of a session
    {"stop": true}                                    any page
"""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.console.space import space_view
from twin.errors import TwinError
from twin.results import si_conversion

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.websockets import WebSocket

    from twin.console.session import Host
    from twin.live import LiveSession
    from twin.scene import SpaceView

PERIOD = 1.0 / 30.0  # of ticks [s]
MAX_TICKS = 90  # ticks with known times: three seconds, longer than any hold lasts
MAX_CHARACTERS = 8192  # of a message
MAX_SIGNALS = 200  # watched signals
MAX_VALUES = 4000  # of all watched signals
MAX_INVALID = 20  # invalid messages before the socket is closed
KINDS = frozenset({"watch", "space", "hold", "release_hold", "here", "stop"})
OPERATOR_KINDS = ("hold", "release_hold", "here")


class PageMessages:
    """Checks and executes the messages of one page. ValueError describes an invalid message in one line."""

    def __init__(self, console: Host, client: str, now: Callable[[], float] = time.monotonic) -> None:
        self._console, self._client, self._now = console, client, now
        self._sent: dict[int, float] = {}
        self.watched: tuple[str, ...] = ()
        self.scales: dict[str, tuple[float, float]] = {}  # factor and offset of the watched signals to SI
        self._run: tuple[LiveSession, int] | None = None
        self.runs = 0  # number of the shown run
        self.shown: dict[str, bytes] = {}  # values of the watched signals as the page has them
        self.space: SpaceView | None = None
        self.frame: dict[str, Any] | None = None  # of that scene, as the page has it

    def sent(self, tick: int) -> None:
        """Record the time of a tick."""
        self._sent[tick] = self._now()
        self._sent.pop(tick - MAX_TICKS, None)

    def begin_run(self, live: LiveSession, epoch: int) -> None:
        """Count a run that differs from the shown one, of which the page has no values."""
        if self._run != (live, epoch):
            self._run, self.shown, self.frame = (live, epoch), {}, None
            self.runs += 1

    def take(self, text: str) -> None:
        """Execute a message."""
        if len(text) > MAX_CHARACTERS:
            raise ValueError(f"a message of {len(text)} characters. At most {MAX_CHARACTERS}.")
        try:
            message = json.loads(text, parse_constant=lambda constant: _refuse(f"{constant} is not a number."))
        except (json.JSONDecodeError, RecursionError):
            raise ValueError("the message is not JSON.") from None
        kinds = [key for key in message if key in KINDS] if isinstance(message, dict) else []
        if len(kinds) != 1:
            raise ValueError(f"expected one of {', '.join(sorted(KINDS))}.")
        kind = kinds[0]
        if kind in OPERATOR_KINDS and not self._console.operator_lock.is_operator(self._client):
            raise ValueError(self._console.operator_lock.watching)
        {
            "watch": self._watch,
            "space": self._space,
            "hold": self._hold,
            "release_hold": self._release_hold,
            "here": self._here,
            "stop": self._stop,
        }[kind](message)

    def _watch(self, message: Mapping[str, Any]) -> None:
        names = message["watch"]
        if not isinstance(names, list) or len(names) > MAX_SIGNALS or not all(isinstance(name, str) for name in names):
            raise ValueError(f"watch: expected up to {MAX_SIGNALS} names.")
        catalog = self._console.catalog
        signals = catalog.signals if catalog is not None else {}
        if wrong := [name for name in names if name not in signals or not signals[name].recorded]:
            raise ValueError(f"watch: {wrong[0][:80]!r} is not recorded.")
        if sum(math.prod(signals[name].shape) for name in names) > MAX_VALUES:
            raise ValueError(f"watch: more than {MAX_VALUES} values.")
        self.watched, self.shown = tuple(dict.fromkeys(names)), {}
        self.scales = {name: si_conversion(signals[name].unit) for name in names}

    def _space(self, message: Mapping[str, Any]) -> None:
        number, catalog = message["space"], self._console.catalog
        spaces = catalog.spaces if catalog is not None else ()
        if number is not None and (type(number) is not int or not 0 <= number < len(spaces)):
            raise ValueError(f"space: expected the number of a scene, below {len(spaces)}, or null.")
        self.frame = None
        self.space = None if number is None or catalog is None else space_view(catalog, number)

    def new_frame(self, live: LiveSession) -> dict[str, Any] | None:
        """Return what moves in the shown scene in three dimensions; None if the page has it."""
        if self.space is None:
            return None
        values = live.latest(self.space.space.names).values
        frame = self.space.frame(values) if all(map(len, values.values())) else None
        is_equal, self.frame = frame == self.frame, frame
        return None if is_equal else frame

    def _hold(self, message: Mapping[str, Any]) -> None:
        live, catalog, name = self._console.live, self._console.catalog, message["hold"]
        control = (
            next((control for control in catalog.controls if control.name == name), None) if catalog and live else None
        )
        activity = next((activity for activity in self._console.activities.values() if name in activity.controls), None)
        if control is None and activity is None:
            raise ValueError(f"hold: {str(name)[:80]!r} is not a control of this scenario.")
        at, press = message.get("at"), message.get("press")
        if isinstance(at, bool) or not isinstance(at, int | float) or not -1.0 <= at <= 1.0:
            raise ValueError("hold: at: expected a number from -1 to 1.")
        number = _check_integer("hold: press", press)
        if (age := self._age("hold", message)) is None:
            return
        if activity is not None:
            activity.hold(name, at, number, age)
        elif control is not None and live is not None:
            live.hold(control.input, control.value(at), number, age)

    def _age(self, kind: str, message: Mapping[str, Any]) -> float | None:
        """Return the age of a message [s] from its tick; None if the tick is too old."""
        left = self._sent.get(_check_integer(f"{kind}: tick", message.get("tick")))
        return None if left is None else self._now() - left

    def _here(self, message: Mapping[str, Any]) -> None:
        if message["here"] is not True:
            raise ValueError("here: expected true.")
        if (age := self._age("here", message)) is not None:
            for activity in self._console.activities.values():
                activity.here(age)

    def _release_hold(self, message: Mapping[str, Any]) -> None:
        live, catalog, name = self._console.live, self._console.catalog, message["release_hold"]
        inputs = {control.name: control.input for control in catalog.controls} if catalog is not None else {}
        activity = next((activity for activity in self._console.activities.values() if name in activity.controls), None)
        if name == "":
            self._console.release_hold()
        elif activity is not None:
            activity.release_hold()
        elif isinstance(name, str) and live is not None and name in inputs:
            live.release_hold(inputs[name])
        else:
            raise ValueError(f"release_hold: {str(name)[:80]!r} is not a control of this scenario.")

    def _stop(self, message: Mapping[str, Any]) -> None:
        if message["stop"] is not True:
            raise ValueError("stop: expected true.")
        self._console.stop()


def _check_integer(what: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**53:
        raise ValueError(f"{what}: expected a whole number.")
    return value


def _refuse(text: str) -> None:
    raise ValueError(text)


def tick_message(console: Host, client: str, tick: int, messages: PageMessages) -> str:
    """Return the message of one tick, with the watched values that have changed."""
    live, lock = console.live, console.operator_lock
    operator = lock.is_operator(client) if lock.operator is not None else None  # null: no page operates
    held = {name: value for activity in console.activities.values() for name, value in activity.held.items()}
    page = {"tick": tick, "stop": console.stop_label, "operator": operator}
    page["watching"] = "" if operator else lock.watching
    page["dropped"] = client not in console.operator_lock.pages
    if live is None:
        return json.dumps({**page, "phase": "", "held": held})
    state, values = live.state, dict[str, Any]()
    instant = state.time
    messages.begin_run(live, state.epoch)
    if messages.watched:
        with suppress(TwinError, OSError):  # a run whose files are closed or removed
            rows = live.latest(messages.watched)
            if state.phase == "running" and len(rows.time):
                instant = float(rows.time[-1])  # of picture and charts, which show recorded rows
            for name, value in rows.values.items():
                if len(value) and messages.shown.get(name) != (present := value[-1].tobytes()):
                    factor, offset = messages.scales[name]
                    messages.shown[name] = present
                    values[name] = plain(value[-1] if factor == 1.0 and not offset else factor * value[-1] + offset)
    frame = None
    with suppress(TwinError, OSError):
        frame = messages.new_frame(live)
    return json.dumps(
        {
            **page,
            "run": messages.runs,
            "phase": state.phase,
            "time": instant,
            "rate": number(state.rate),
            "achieved": number(state.achieved),
            "lag": state.lag,
            "epoch": state.epoch,
            "held": held | {name: plain(np.asarray(held_value)) for name, held_value in state.held.items()},
            "values": values,
            "message": state.message,
            **({"space": frame} if frame else {}),
        },
        allow_nan=False,
    )


def number(value: float) -> float | None:
    """Return a finite number, or None for JSON."""
    return value if math.isfinite(value) else None


def plain(value: Any) -> Any:
    """Return a value or an array as plain data, with None for non-finite numbers."""
    if value.dtype.kind != "f" or np.isfinite(value).all():
        return value.tolist()
    return [plain(item) for item in value] if value.ndim else None


def register(app: FastAPI, console: Host, is_page: Callable[[str], bool]) -> None:
    """Serve the socket; `is_page` tells whether a client name belongs to a page of this server."""
    latest: dict[str, WebSocket] = {}  # socket of each page

    async def pages(socket: WebSocket) -> None:
        client = socket.query_params.get("client", "")
        if not is_page(client):
            await socket.close(1008)
            return
        await socket.accept()
        messages = PageMessages(console, client)
        latest[client] = socket
        console.operator_lock.enter(client)
        sender = asyncio.create_task(send_ticks(socket, messages))
        try:
            await receive_messages(socket, messages)
        finally:
            sender.cancel()
            if latest[client] is socket:  # a page that has reconnected may be ahead of the end of its former socket
                del latest[client]
                leave(client)

    def leave(client: str) -> None:
        if console.operator_lock.is_operator(client):
            console.release_hold()
        console.operator_lock.leave(client)

    async def send_ticks(socket: WebSocket, messages: PageMessages) -> None:
        from starlette.websockets import WebSocketDisconnect

        client, tick = socket.query_params["client"], 0
        try:
            with suppress(RuntimeError, OSError, WebSocketDisconnect):  # the socket is closed
                while True:
                    if not is_page(client) and client in console.operator_lock.pages:
                        leave(client)  # dropped by the server: its buttons are dead, only STOP still arrives
                    tick += 1
                    text = tick_message(console, client, tick, messages)
                    messages.sent(tick)
                    await socket.send_text(text)
                    await asyncio.sleep(PERIOD)
        finally:  # a page with an open socket and without ticks would stay gray; without a socket it connects again
            with suppress(RuntimeError, OSError, WebSocketDisconnect):
                await socket.close()

    async def receive_messages(socket: WebSocket, messages: PageMessages) -> None:
        from starlette.websockets import WebSocketDisconnect

        wrong = 0
        with suppress(WebSocketDisconnect, RuntimeError, KeyError):  # KeyError: bytes instead of text
            while wrong < MAX_INVALID:
                text = await socket.receive_text()
                try:
                    messages.take(text)
                except ValueError as error:
                    wrong += 1
                    await socket.send_text(json.dumps({"refused": str(error)}))
            await socket.close(1008)

    from starlette.routing import WebSocketRoute

    app.router.routes.append(WebSocketRoute("/wire", pages))
