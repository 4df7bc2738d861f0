"""The page's own socket: thirty times a second how things stand, and back what a hand holds.

A page answers each tick with what is held, and names the tick: so the loop knows how old a command is, whatever a network has
kept it back for. Nothing that comes is trusted: see `Orders`. To the page:

    {"tick", "phase", "time", "rate", "achieved", "lag", "epoch", "operator", "held", "values", "message"}

From the page, one of these, up to LARGEST characters:

    {"watch": [name, ...]}                          of these the values are told with each tick
    {"hold": control, "at": -1 to 1, "press": number of the press, "tick": the last that was seen}     the operator alone
    {"let_go": control, or "" for all}              the operator alone
    {"stop": true}                                  anybody: whoever sees a danger
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

from twin.live import RefusedError

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.websockets import WebSocket

    from twin.console.session import Host

PERIOD = 1.0 / 30.0  # of ticks [s]
TICKS = 90  # so many are remembered: three seconds, while a command lives for 0.14 s
LARGEST = 8192  # of a message [characters]
WATCHED = 200  # signals, and of their values together:
ELEMENTS = 4000
WRONG = 20  # messages that cannot be: then the page is sent away
WORDS = frozenset({"watch", "hold", "let_go", "stop"})


class Orders:
    """What one page has said, checked. ValueError tells it in one line what was wrong."""

    def __init__(self, console: Host, client: str, now: Callable[[], float] = time.monotonic) -> None:
        self._console, self._client, self._now = console, client, now
        self._sent: dict[int, float] = {}
        self.watched: tuple[str, ...] = ()

    def sent(self, tick: int) -> None:
        """A tick leaves now."""
        self._sent[tick] = self._now()
        self._sent.pop(tick - TICKS, None)

    def take(self, text: str) -> None:
        """Obey a message."""
        if len(text) > LARGEST:
            raise ValueError(f"a message of {len(text)} characters. At most {LARGEST}.")
        try:
            said = json.loads(text, parse_constant=lambda one: _refuse(f"{one} is no number."))
        except (json.JSONDecodeError, RecursionError):
            raise ValueError("a message that is no JSON.") from None
        words = [one for one in said if one in WORDS] if isinstance(said, dict) else []
        if len(words) != 1:
            raise ValueError(f"a message must say one of {', '.join(sorted(WORDS))}.")
        word = words[0]
        if word in ("hold", "let_go") and not self._console.seats.may(self._client):
            raise ValueError("this page watches. Another one operates.")
        {"watch": self._watch, "hold": self._hold, "let_go": self._let_go, "stop": self._stop}[word](said)

    def _watch(self, said: Mapping[str, Any]) -> None:
        names = said["watch"]
        if not isinstance(names, list) or len(names) > WATCHED or not all(isinstance(one, str) for one in names):
            raise ValueError(f"watch: expected up to {WATCHED} names.")
        catalog = self._console.catalog
        known = catalog.signals if catalog is not None else {}
        if wrong := [one for one in names if one not in known or not known[one].recorded]:
            raise ValueError(f"watch: {wrong[0][:80]!r} is not recorded.")
        if sum(math.prod(known[one].shape) for one in names) > ELEMENTS:
            raise ValueError(f"watch: more than {ELEMENTS} values.")
        self.watched = tuple(dict.fromkeys(names))

    def _hold(self, said: Mapping[str, Any]) -> None:
        live, catalog = self._console.live, self._console.catalog
        control = next((one for one in catalog.controls if one.name == said["hold"]), None) if catalog else None
        if live is None or control is None:
            raise ValueError(f"hold: {str(said['hold'])[:80]!r} is no control of this scenario.")
        at, press, tick = said.get("at"), said.get("press"), said.get("tick")
        if isinstance(at, bool) or not isinstance(at, int | float) or not -1.0 <= at <= 1.0:
            raise ValueError("hold: at: expected a number from -1 to 1.")
        for name, one in (("press", press), ("tick", tick)):
            if isinstance(one, bool) or not isinstance(one, int) or not 0 <= one < 2**53:
                raise ValueError(f"hold: {name}: expected a whole number.")
        if (left := self._sent.get(tick)) is not None:  # type: ignore[arg-type] # an int by now
            live.hold(control.input, control.value(at), press, self._now() - left)  # type: ignore[arg-type]

    def _let_go(self, said: Mapping[str, Any]) -> None:
        live, catalog, name = self._console.live, self._console.catalog, said["let_go"]
        inputs = {one.name: one.input for one in catalog.controls} if catalog is not None else {}
        if live is None or not isinstance(name, str) or (name and name not in inputs):
            raise ValueError(f"let_go: {str(name)[:80]!r} is no control of this scenario.")
        live.let_go(inputs[name] if name else "")

    def _stop(self, said: Mapping[str, Any]) -> None:
        if said["stop"] is not True:
            raise ValueError("stop: expected true.")
        self._console.stop()


def _refuse(text: str) -> None:
    raise ValueError(text)


def told(console: Host, client: str, tick: int, watched: tuple[str, ...]) -> str:
    """One tick."""
    live, operator = console.live, console.seats.may(client)
    if live is None:
        return json.dumps({"tick": tick, "phase": "", "operator": operator})
    state, values = live.state, dict[str, Any]()
    if watched:
        with suppress(RefusedError):
            found = live.latest(watched)
            values = {name: plain(one[-1]) for name, one in found.values.items() if len(one)}
    return json.dumps(
        {
            "tick": tick, "phase": state.phase, "time": state.time, "rate": number(state.rate),
            "achieved": number(state.achieved), "lag": state.lag, "epoch": state.epoch, "operator": operator,
            "held": {name: plain(np.asarray(one)) for name, one in state.held.items()}, "values": values,
            "message": state.message,
        },
        allow_nan=False,
    )  # fmt: skip


def number(value: float) -> float | None:
    """What JSON has for a number."""
    return value if math.isfinite(value) else None


def plain(value: Any) -> Any:
    """A value or an array, with null for what is not finite."""
    if value.dtype.kind != "f" or np.isfinite(value).all():
        return value.tolist()
    return [plain(one) for one in value] if value.ndim else None


def register(app: FastAPI, console: Host, known: Callable[[str], bool]) -> None:
    """Serve the socket; `known` says whether a page of that name was made here."""

    async def pages(socket: WebSocket) -> None:
        client = socket.query_params.get("client", "")
        if not known(client):
            await socket.close(1008)
            return
        await socket.accept()
        orders = Orders(console, client)
        console.seats.enter(client)
        telling = asyncio.create_task(tell(socket, orders))
        try:
            await listen(socket, orders)
        finally:
            telling.cancel()
            if console.seats.may(client) and console.live is not None:
                console.live.let_go()
            console.seats.leave(client)

    async def tell(socket: WebSocket, orders: Orders) -> None:
        client, tick = socket.query_params["client"], 0
        with suppress(RuntimeError, OSError):  # it is gone
            while True:
                tick += 1
                text = told(console, client, tick, orders.watched)
                orders.sent(tick)
                await socket.send_text(text)
                await asyncio.sleep(PERIOD)

    async def listen(socket: WebSocket, orders: Orders) -> None:
        from starlette.websockets import WebSocketDisconnect

        wrong = 0
        with suppress(WebSocketDisconnect, RuntimeError, KeyError):  # the last: bytes instead of text
            while wrong < WRONG:
                text = await socket.receive_text()
                try:
                    orders.take(text)
                except ValueError as error:
                    wrong += 1
                    await socket.send_text(json.dumps({"refused": str(error)}))
            await socket.close(1008)

    from starlette.routing import WebSocketRoute

    app.router.routes.append(WebSocketRoute("/wire", pages))
