"""One case of a run on drives: from the first step, which enables them, to the stop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import CycleTimeBudget
from hw_bridge.master import LateCyclePolicy, Master, block_signals
from hw_bridge.plant import set_up, start_position
from hw_bridge.session.contact import ContactWatch
from hw_bridge.session.output_bindings import bind_outputs
from hw_bridge.session.run_outcome import RunOutcome
from hw_bridge.session.target_dispatcher import TargetDispatcher
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
class Observers:
    """Factories of a case's bus listener and of its drives' observers.

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
        observer_factories: Observers,
        trace: Path | None = None,
        faults: Sequence[Override] = (),
        variant: str = "",
    ) -> None:
        self.variant = variant
        self.keys, self.contacts, self.build, self.trace, self.faults = keys, contacts, build, trace, faults
        self.observer_factories = observer_factories
        self.orders = TargetDispatcher(keys)
        self.outcome = RunOutcome()
        self.late_cycle_policy = LateCyclePolicy(keys)
        self.bench: Bench | None = None
        self.listener: Listener | None = None
        self.master: Master | None = None
        self.observers: Mapping[str, Observer] = {}
        self.watches: dict[str, ContactWatch] = {}
        self.outputs: list[tuple[Any, Callable[[], float]]] = []
        self.is_started = self.closed = self.real_time = self.failed = False
        self.running = False  # all drives were brought up
        self.wall_clock = not keys.simulated
        self.stepped: set[str] = set()
        self.origin = 0  # time of the network at the scenario's zero [ns]
        self.start = 0
        self.before = CycleTimeBudget(), 0  # before the first cycle, and its time [ns]
        self.cycle_times: dict[str, float] = {}  # wall-clock time per cycle, by activity [s]

    def join(self, name: str, axis: Component, forced: bool = False) -> None:
        """Add a member that a drive replaces; `forced`: it has target forces."""
        self.orders.axes[name] = axis
        self.orders.forced |= {name} if forced else set()

    def join_module(self, name: str, switch: Component) -> None:
        """Add a member that an I/O module replaces."""
        self.orders.switches[name] = switch

    @property
    def members(self) -> set[str]:
        """Names of the members that have joined."""
        return {*self.orders.axes, *self.orders.switches}

    def network(self) -> Network:
        """Open the bus, with simulated drives where they are part of the run."""
        self.bench = set_up(self.keys, self.orders.axes, self.build)
        return self.bench.network

    def step(self, member: str, t: float, h: float) -> None:
        """Register the targets of a member; after the last member's, advance from t to t + h [s]."""
        self.stepped.add(member)
        if self.stepped == self.members:
            self.stepped.clear()
            try:
                self.advance(round(t * 1e9), round(h * 1e9))
            except BaseException as error:
                self.failed = True
                if self.running and isinstance(error, SimulationError):
                    self.outcome.stopped = round(t * 1e9), str(error)
                self.close()
                if self.master is not None and isinstance(error, SimulationError):
                    if self.wall_clock:
                        self.outcome.notes.append(self.master.next_step())
                    raise SimulationError(self.master.describe_failure(str(error))) from error
                raise

    def advance(self, t: int, h: int) -> None:
        """Advance the bus from t to t + h [ns]."""
        if self.bench is not None:
            self.bench.update_load()
        for observer in self.observers.values():
            observer.update_load()
        if not self.is_started:
            self.begin(t)
        master = self.master
        assert master is not None
        for name, watch in self.watches.items():
            watch.look(t, float(self.orders.axes[name].views["contact_force"]))
        if (t - self.start) % self.keys.cycle == 0:
            self.origin += self.late_cycle_policy.check(master.network.now - (self.origin + t), master.network.now)
            if problem := master.check():
                raise SimulationError(f"{problem} All drives stop.")
            if t > self.start:
                for observer in self.observers.values():
                    observer.look(t)
            self.orders.set_targets(master, self.watches)
            if self.late_cycle_policy.slow(master.network.now):
                self.run_half_cycle(t)
            self.exchange(t)
        master.wait_until(self.origin + t + h)
        for view, value in self.outputs:
            view[...] = value()

    def begin(self, t: int) -> None:
        """Enable the drives, if their targets can be followed."""
        orders, keys = self.orders, self.keys
        orders.begin()
        network = self.network()
        self.listener = self.observer_factories.listener(keys, network, self.trace)
        master = self.master = Master(keys, network, orders.forced)
        master.announce = self.observer_factories.announce
        self.is_started, self.start, self.real_time = True, t, master.network.real_time
        self.observers = self.observer_factories.observers(keys, network, orders.axes, master.nodes, self.build)
        for name, axis in orders.axes.items():
            master.nodes[name].rotary = "angle" in axis.views
        master.begin({name: start_position(axis) for name, axis in orders.axes.items()})
        self.origin = master.network.now - t
        assert self.bench is not None
        self.bench.plan(self.faults, self.origin)
        self.bench.zero({name: node.position for name, node in master.nodes.items()})
        for name, contact in self.contacts.items():
            self.watches[name] = ContactWatch(name, contact, master.nodes[name], t)
        self.outputs = bind_outputs(master.nodes, orders.axes, self.bench)
        self.before = replace(master.network.time_budget), master.network.now
        self.running = True

    def run_half_cycle(self, t: int) -> None:
        """Run the first half of a cycle at half speed: it takes a full cycle of the drives while the scenario waits."""
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
        """Exchange targets and SYNC of the cycle at t [ns]."""
        master = self.master
        assert master is not None
        synced = master.exchange(self.origin + t)
        master.timing.synced(synced, self.origin + t + master.lead)

    def close(self) -> None:
        """Stop everything, once; a signal before or meanwhile does not keep it from that."""
        with block_signals():
            if not self.closed:
                self.closed = True
                self._close()

    def _close(self) -> None:
        outcome = self.outcome
        if self.master is not None:
            if self.running and self.wall_clock:
                network, (budget, since) = self.master.network, self.before
                cycles = len(self.master.timing.sent)
                self.cycle_times = network.time_budget.since(budget, network.now - since, cycles)
            self.master.stop()
            outcome.notes += self.master.notes
            if outcome.stopped is not None:
                time, reason = outcome.stopped
                outcome.stopped = time, self.master.describe_failure(reason)
            elif not self.failed:  # else the failure names them
                outcome.notes += self.master.fault_texts
        elif self.bench is not None:  # its trace cannot be written, for example
            self.bench.network.close()
        if self.bench is not None:
            outcome.record_faults_at_rest(self.bench, self.failed)
        if self.listener is not None:
            outcome.notes += filter(None, [self.listener.close()])
            outcome.bus_events = self.timeline()
        outcome.notes += [line for observer in self.observers.values() for line in observer.warnings]

    def timeline(self) -> list[str]:
        """Bus events until now, with faults and the stop, sorted by time."""
        assert self.listener is not None
        acted = self.bench.acted(self.faults, self.origin) if self.bench is not None else []
        return self.outcome.timeline(acted, self.listener.events(self.origin))

    def report(self) -> dict[str, Any]:
        """Statistics of the case."""
        assert self.master is not None
        report = self.master.report() | self.late_cycle_policy.report() | {"real_time_priority": self.real_time}
        report |= {"spent": self.cycle_times} if self.cycle_times else {}
        if self.observers:
            report["shadow"] = {name: observer.report() for name, observer in self.observers.items()}
        if self.listener is not None:
            report |= {"origin": self.origin / 1e9, "seen": self.outcome.bus_events if self.closed else self.timeline()}
            report |= {"trace": str(self.trace), "frames": self.listener.count} if self.trace is not None else {}
        return report | (self.bench.report() if self.bench is not None else {})
