"""The page's own socket: thirty times a second how things stand, and back what a hand holds.

A page answers each tick with what is held, and names the tick: so the loop knows how old a command is, whatever a network has
kept it back for. Nothing that comes is trusted: see `Orders`. To the page:

    {"tick", "phase", "time", "rate", "achieved", "lag", "epoch", "operator", "attend", "held", "values", "message"}

From the page, one of these, up to LARGEST characters:

    {"watch": [name, ...]}                          of these the values are told with each tick
    {"hold": control, "at": -1 to 1, "press": number of the press, "tick": the last that was seen}     the operator alone
    {"release_hold": control, or "" for all}              the operator alone
    {"here": true, "tick": the last that was seen}  the operator alone: the page shows what moves beside a session
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
WORDS = frozenset({"watch", "hold", "release_hold", "here", "stop"})
OPERATORS = ("hold", "release_hold", "here")


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
        if word in OPERATORS and not self._console.seats.is_operator(self._client):
            raise ValueError("this page watches. Another one operates.")
        {
            "watch": self._watch,
            "hold": self._hold,
            "release_hold": self._release_hold,
            "here": self._here,
            "stop": self._stop,
        }[word](said)

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
        live, catalog, name = self._console.live, self._console.catalog, said["hold"]
        control = next((one for one in catalog.controls if one.name == name), None) if catalog and live else None
        beside = next((one for one in self._console.beside.values() if name in one.controls), None)
        if control is None and beside is None:
            raise ValueError(f"hold: {str(name)[:80]!r} is no control of this scenario.")
        at, press = said.get("at"), said.get("press")
        if isinstance(at, bool) or not isinstance(at, int | float) or not -1.0 <= at <= 1.0:
            raise ValueError("hold: at: expected a number from -1 to 1.")
        number = _whole("hold: press", press)
        if (age := self._age("hold", said)) is None:
            return
        if beside is not None:
            beside.hold(name, at, number, age)
        elif control is not None and live is not None:
            live.hold(control.input, control.value(at), number, age)

    def _age(self, word: str, said: Mapping[str, Any]) -> float | None:
        """How old a message is by the tick that it answers [s]; None where that is forgotten."""
        left = self._sent.get(_whole(f"{word}: tick", said.get("tick")))
        return None if left is None else self._now() - left

    def _here(self, said: Mapping[str, Any]) -> None:
        if said["here"] is not True:
            raise ValueError("here: expected true.")
        if (age := self._age("here", said)) is not None:
            for one in self._console.beside.values():
                one.here(age)

    def _release_hold(self, said: Mapping[str, Any]) -> None:
        live, catalog, name = self._console.live, self._console.catalog, said["release_hold"]
        inputs = {one.name: one.input for one in catalog.controls} if catalog is not None else {}
        beside = next((one for one in self._console.beside.values() if name in one.controls), None)
        if name == "":
            self._console.release_hold()
        elif beside is not None:
            beside.release_hold()
        elif isinstance(name, str) and live is not None and name in inputs:
            live.release_hold(inputs[name])
        else:
            raise ValueError(f"release_hold: {str(name)[:80]!r} is no control of this scenario.")

    def _stop(self, said: Mapping[str, Any]) -> None:
        if said["stop"] is not True:
            raise ValueError("stop: expected true.")
        self._console.stop()


def _whole(what: str, one: Any) -> int:
    if isinstance(one, bool) or not isinstance(one, int) or not 0 <= one < 2**53:
        raise ValueError(f"{what}: expected a whole number.")
    return one


def _refuse(text: str) -> None:
    raise ValueError(text)


def told(console: Host, client: str, tick: int, watched: tuple[str, ...]) -> str:
    """One tick."""
    live, operator = console.live, console.seats.is_operator(client)
    beside = {name: value for one in console.beside.values() for name, value in one.held.items()}
    attend = any(one.attended for one in console.beside.values())
    if live is None:
        return json.dumps({"tick": tick, "phase": "", "operator": operator, "attend": attend, "held": beside})
    state, values = live.state, dict[str, Any]()
    if watched:
        with suppress(RefusedError):
            found = live.latest(watched)
            values = {name: plain(one[-1]) for name, one in found.values.items() if len(one)}
    return json.dumps(
        {
            "tick": tick, "phase": state.phase, "time": state.time, "rate": number(state.rate),
            "achieved": number(state.achieved), "lag": state.lag, "epoch": state.epoch, "operator": operator,
            "attend": attend, "held": beside | {name: plain(np.asarray(one)) for name, one in state.held.items()},
            "values": values, "message": state.message,
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
            if console.seats.is_operator(client):
                console.release_hold()
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
