"""One case of a run on drives: from the first step, which brings them up, to the stop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Spent
from hw_bridge.master import Master
from hw_bridge.plant import beginning, set_up
from hw_bridge.session.account import Account
from hw_bridge.session.contact import ContactWatch
from hw_bridge.session.orders import Orders
from hw_bridge.session.pace import Pace
from hw_bridge.session.showing import shown
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from hw_bridge.bus import Listener, Network, Observer, Override
    from hw_bridge.hardware import ContactKeys, HardwareKeys
    from hw_bridge.master import Node
    from hw_bridge.plant import Bench
    from twin.component import Component

    Listening = Callable[[HardwareKeys, Network, Path | None], Listener]
    Observing = Callable[
        [HardwareKeys, Network, Mapping[str, Component], Mapping[str, Node], Path], Mapping[str, Observer]
    ]


@dataclass(frozen=True)
class Company:
    """Who looks on: how the listener of a case is made, and the observers of its drives.

    `announce`: called before anything is written.
    """

    listener: Listening
    observers: Observing
    announce: Callable[[Master], None] | None = None


class Session:
    """Drives and their master during one case."""

    def __init__(
        self,
        keys: HardwareKeys,
        contacts: Mapping[str, ContactKeys],
        build: Path,
        company: Company,
        trace: Path | None = None,
        faults: Sequence[Override] = (),
        variant: str = "",
    ) -> None:
        self.variant = variant
        self.keys, self.contacts, self.build, self.trace, self.faults = keys, contacts, build, trace, faults
        self.company = company
        self.orders = Orders(keys)
        self.account = Account()
        self.pace = Pace(keys)
        self.bench: Bench | None = None
        self.listener: Listener | None = None
        self.master: Master | None = None
        self.observers: Mapping[str, Observer] = {}
        self.watches: dict[str, ContactWatch] = {}
        self.outputs: list[tuple[Any, Callable[[], float]]] = []
        self.begun = self.closed = self.real_time = self.failed = False
        self.running = False  # all drives were brought up
        self.wall_clock = not keys.simulated
        self.stepped: set[str] = set()
        self.origin = 0  # time of the network at the scenario's zero [ns]
        self.start = 0
        self.before = Spent(), 0  # on the bringing up, until when [ns]
        self.spent: dict[str, float] = {}  # of a cycle by the wall clock, by what it went to [s]

    def join(self, name: str, axis: Component, forced: bool = False) -> None:
        """A member that stands for a drive; `forced`: it is told a force."""
        self.orders.axes[name] = axis
        self.orders.forced |= {name} if forced else set()

    def join_module(self, name: str, switch: Component) -> None:
        """A member that stands for an I/O module."""
        self.orders.switches[name] = switch

    @property
    def members(self) -> set[str]:
        """Names of those that have joined."""
        return {*self.orders.axes, *self.orders.switches}

    def network(self) -> Network:
        """The bus, with its simulated drives where they are part of the run."""
        self.bench = set_up(self.keys, self.orders.axes, self.build)
        return self.bench.network

    def step(self, member: str, t: float, h: float) -> None:
        """The targets of a member are there; with the last one everything goes on from t to t + h [s]."""
        self.stepped.add(member)
        if self.stepped == self.members:
            self.stepped.clear()
            try:
                self.advance(round(t * 1e9), round(h * 1e9))
            except BaseException as error:
                self.failed = True
                if self.running and isinstance(error, SimulationError):
                    self.account.stopped = round(t * 1e9), str(error)
                self.close()
                if self.master is not None and isinstance(error, SimulationError):
                    if self.wall_clock:
                        self.account.notes.append(self.master.next_step())
                    raise SimulationError(self.master.describe_failure(str(error))) from error
                raise

    def advance(self, t: int, h: int) -> None:
        """Let the bus go from t to t + h [ns]."""
        if self.bench is not None:
            self.bench.feel()
        for observer in self.observers.values():
            observer.feel()
        if not self.begun:
            self.begin(t)
        master = self.master
        assert master is not None
        for name, watch in self.watches.items():
            watch.look(t, float(self.orders.axes[name].views["contact_force"]))
        if (t - self.start) % self.keys.cycle == 0:
            self.origin += self.pace.judge(master.network.now - (self.origin + t), master.network.now)
            if problem := master.check():
                raise SimulationError(f"{problem} All drives stop.")
            if t > self.start:
                for observer in self.observers.values():
                    observer.look(t)
            self.orders.give(master, self.watches)
            if self.pace.slow(master.network.now):
                self.half(t)
            self.exchange(t)
        master.wait_until(self.origin + t + h)
        for view, value in self.outputs:
            view[...] = value()

    def begin(self, t: int) -> None:
        """Bring the drives up, if they are told what they can do."""
        orders, keys = self.orders, self.keys
        orders.begin()
        network = self.network()
        self.listener = self.company.listener(keys, network, self.trace)
        master = self.master = Master(keys, network, orders.forced)
        master.announce = self.company.announce
        self.begun, self.start, self.real_time = True, t, master.network.real_time
        self.observers = self.company.observers(keys, network, orders.axes, master.nodes, self.build)
        for name, axis in orders.axes.items():
            master.nodes[name].rotary = "angle" in axis.views
        master.begin({name: beginning(axis) for name, axis in orders.axes.items()})
        self.origin = master.network.now - t
        assert self.bench is not None
        self.bench.plan(self.faults, self.origin)
        self.bench.zero({name: node.position for name, node in master.nodes.items()})
        for name, contact in self.contacts.items():
            self.watches[name] = ContactWatch(name, contact, master.nodes[name], t)
        self.outputs = shown(master.nodes, orders.axes, self.bench)
        self.before = replace(master.network.spent), master.network.now
        self.running = True

    def half(self, t: int) -> None:
        """Half of the way to the targets of a cycle: the drives take a cycle for it, the scenario waits meanwhile."""
        master = self.master
        assert master is not None
        for node in master.nodes.values():
            node.first_half_step()
        self.exchange(t)
        self.origin += self.keys.cycle
        master.wait_until(self.origin + t)
        if problem := master.check():
            raise SimulationError(f"{problem} All drives stop.")
        for node in master.nodes.values():
            node.second_half_step()

    def exchange(self, t: int) -> None:
        """Targets and SYNC of the cycle at t [ns]."""
        master = self.master
        assert master is not None
        synced = master.exchange(self.origin + t)
        master.timing.synced(synced, self.origin + t + master.lead)

    def close(self) -> None:
        """Stop everything; once."""
        if self.closed:
            return
        self.closed = True
        account = self.account
        if self.master is not None:
            if self.running and self.wall_clock:
                network, (spent, since) = self.master.network, self.before
                cycles = len(self.master.timing.sent)
                self.spent = network.spent.since(spent, network.now - since, cycles)
            self.master.stop()
            account.notes += self.master.notes
            if account.stopped is not None:
                time, reason = account.stopped
                account.stopped = time, self.master.describe_failure(reason)
        if self.bench is not None:
            account.look_after(self.bench, self.failed)
        if self.listener is not None:
            self.listener.close()
            account.seen = self.story()
        account.notes += [line for observer in self.observers.values() for line in observer.warnings]

    def story(self) -> list[str]:
        """What was seen on the bus until now, with faults and the stop in their places."""
        assert self.listener is not None
        acted = self.bench.acted(self.faults, self.origin) if self.bench is not None else []
        return self.account.story(acted, self.listener.seen(self.origin))

    def report(self) -> dict[str, Any]:
        """Statistics of the case."""
        assert self.master is not None
        found = self.master.report() | self.pace.report() | {"real_time_priority": self.real_time}
        found |= {"spent": self.spent} if self.spent else {}
        if self.observers:
            found["shadow"] = {name: observer.report() for name, observer in self.observers.items()}
        if self.listener is not None:
            found |= {"origin": self.origin / 1e9, "seen": self.account.seen if self.closed else self.story()}
            found |= {"trace": str(self.trace), "frames": self.listener.count} if self.trace is not None else {}
        return found | (self.bench.report() if self.bench is not None else {})
