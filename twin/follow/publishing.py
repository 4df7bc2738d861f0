"""Publishing of a run in real time: recorded signals as JSON messages, so that another process follows it as a rig."""

from __future__ import annotations

import json
import socket
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import SimulationError, TwinError
from twin.follow.schema import address, scheme_of, topic_address
from twin.follow.sources.topics import Report, Sender, connect
from twin.run import Progress, apply_event

if TYPE_CHECKING:
    from twin.coupling import CoSimulation, MemberVariable
    from twin.scenario import Case

UNITS_EVERY = 1.0  # units are sent this often, for receivers that start later [s]


class UdpSender:
    """Sender of datagrams to an address."""

    largest = 60_000

    def __init__(self, host: str, port: int) -> None:
        self.address = host, port
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, data: bytes) -> None:
        """Send a datagram."""
        try:
            self.socket.sendto(data, self.address)
        except ConnectionRefusedError:  # nothing receives there yet
            pass
        except OSError as error:
            raise SimulationError(
                f"--publish {self.address[0]}:{self.address[1]}: cannot be sent ({error.strerror})."
            ) from None

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()


def open_sender(target: str, report: Report) -> Sender:
    """Open the sender to `udp://HOST:PORT`, `mqtt://BROKER:PORT/TOPIC` or `zenoh://ROUTER:PORT/TOPIC`; TwinError if that is impossible.

    `report`: gets lines about its connection.
    """
    try:
        if not (scheme := scheme_of(target)):
            return UdpSender(*address(target))
        topic = topic_address(target, scheme)
    except ValueError as error:
        raise TwinError(f"--publish: {error}.") from None
    if set(topic.topic) & set(wildcards := "+#" if scheme == "mqtt" else "*$"):
        raise TwinError(f"--publish: expected a topic without {' and '.join(wildcards)}, not {topic.topic}.")
    return connect("--publish", topic, report)


class Publisher:
    """Runner of cases at the pace of the wall clock that sends recorded numbers after each recorded step. `problems`: lines about its connection.

    A message is `{"time": 1.25, "sheath.tip_position": 0.0031, ...}`; once a second it has `units`, too. `time`: of the case [s].
    """

    def __init__(self, target: str) -> None:
        self.problems: list[str] = []
        self.sender = open_sender(target, self.problems.append)

    def run_case(self, case: Case, cosimulation: CoSimulation, progress: Progress) -> None:
        """Run a case with its events from its start to its stop; SimulationError if the signals cannot be sent."""
        catalog = {name: member.variables for name, member in cosimulation.members.items()}
        cosimulation.initialize(case.start_ns, case.stop_ns)
        recorded = [(key, catalog[key[0]][key[1]]) for key in cosimulation.recorded]
        begin, events = time.monotonic(), list(case.events)
        units_due = now = clock.seconds(case.start_ns)
        start, duration = now, max(clock.seconds(case.stop_ns) - now, 1e-9)
        while True:
            while events and events[0].time_ns <= cosimulation.time:
                apply_event(events.pop(0), case, cosimulation, catalog)
            self._send(now, recorded, cosimulation, with_units=now >= units_due)
            while self.problems:
                if (line := f"--publish: {self.problems.pop()}") not in cosimulation.notes:
                    cosimulation.notes.append(line)
            units_due += UNITS_EVERY * (now >= units_due)
            progress(case.name, (now - start) / duration)
            if cosimulation.finished or cosimulation.time >= case.stop_ns:
                return
            until = min(cosimulation.time + cosimulation.every, case.stop_ns)
            if events:
                until = min(until, events[0].time_ns)
            cosimulation.advance(until)
            now = clock.seconds(cosimulation.time)
            time.sleep(max(begin + now - start - time.monotonic(), 0.0))

    def _send(
        self,
        now: float,
        recorded: list[tuple[tuple[str, str], MemberVariable]],
        cosimulation: CoSimulation,
        *,
        with_units: bool,
    ) -> None:
        content: dict[str, Any] = {"time": now}
        units: dict[str, str] = {}
        for key, variable in recorded:
            if variable.dtype.kind not in "fiub":
                continue
            name, values = ".".join(key), np.ravel(cosimulation.value(key))
            for index, value in enumerate(values.tolist()):
                label = f"{name}[{index + 1}]" if variable.shape else name
                content[label] = value
                units[label] = variable.unit
        if with_units:
            content["units"] = units
        data = json.dumps(content).encode()
        if len(data) > self.sender.largest:
            raise SimulationError(
                f"--publish: {len(content) - 1} signals are too many for a message. Record fewer: record: {{variables: [...]}}."
            )
        self.sender.send(data)
