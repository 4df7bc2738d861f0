"""Connected Model Exchange members as one system of equations: one state, one solver, common events.

From one communication point to the next the solver takes steps of its own, none beyond that point. An event ends a step:
a state event where an event indicator changes its sign, found on the solver's interpolation; a time event that a member
announced; a step event. Then all members are in Event Mode, until none needs another iteration and no value between them
changes, and the solver begins anew.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import CouplingError, SimulationError
from twin.fmi.model_exchange import solvers
from twin.fmi.model_exchange.connections import Couplings
from twin.fmi.model_exchange.solvers import Discarded, Equations
from twin.fmi.model_exchange.system_jacobian import Jacobian, offered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.coupling import ResolvedConnection
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember
    from twin.fmi.model_exchange.sensitivity import Sensitivity

Vector = np.ndarray[Any, Any]

EVENT_ITERATIONS = 100
EVENTS, CLOSE = 100, 1e-6  # as many in so small a part of a communication step have no end
ROUNDING = 100 * float(np.finfo(np.float64).eps)  # of a time: what lies closer is at that time
FIRST_STEP = 0.1  # of the last step [ratio]: the first one after values from outside have changed


class ContinuousSystem:
    """Members with their connections. `step` goes from one communication point to the next, for all members at once."""

    def __init__(self, members: Sequence[ExchangeMember], links: Sequence[ResolvedConnection]) -> None:
        self.members, self.links = members, links
        self.names = ", ".join(member.name for member in members)
        self.solver_name = self._common([member.solver for member in members if member.solver])
        self.t = self.due = np.inf
        self.y = np.zeros(0)
        self.ended = self.is_fresh = self.is_restored = self.is_overridden = False
        self.last_before = -np.inf  # the time just before the last state event [s]
        self.last = 0.0  # length of the solver's last step [s]
        self.events: deque[float] = deque(maxlen=EVENTS)  # times of the last ones
        self.sensitivity: Sensitivity | None = None

    def _common(self, given: list[str]) -> str:
        if len(set(given)) > 1:
            raise CouplingError(
                f"{self.names}: are connected and integrated together, but with different solvers "
                f"({', '.join(dict.fromkeys(given))}). Give all of them the same."
            )
        return given[0] if given else solvers.DEFAULT

    def start(self) -> None:
        """The event that every member is in after initialization."""
        self.t = self.members[0].begin
        self.couplings = Couplings(self.members, self.links)
        self.restart()

    def restart(self) -> None:
        """Begin anew at the present time, at which every member is in Event Mode."""
        self.iterate()
        ends = np.cumsum([len(member.states) for member in self.members])
        self.parts = [slice(end - len(member.states), end) for member, end in zip(self.members, ends, strict=True)]
        tolerance = min((member.tolerance for member in self.members if member.tolerance), default=solvers.TOLERANCE)
        nominals = np.abs(np.concatenate([member.nominals for member in self.members]))
        self.begin()
        equations = Equations(
            self.differentiate, self.jacobian(), tolerance, tolerance * np.where(nominals > 0, nominals, 1.0)
        )
        self.solver = solvers.make(self.solver_name, equations)
        self.sensitivity = next((member.sensitivity for member in self.members if member.sensitivity), None)
        if self.sensitivity and not self.ended:
            self.sensitivity.start(self)
        self.publish()

    def jacobian(self) -> Jacobian | None:
        """Build the Jacobian from the members' directional derivatives, if available; some FMUs declare them, and fail when called."""
        if self.ended or not offered(self.members):
            return None
        made = Jacobian(self.members, self.links, self.move_to)
        try:
            made(self.t, self.y)
        except (Discarded, np.linalg.LinAlgError):
            return None
        return made

    def reset_states(self) -> None:
        """Begin anew at the present time with the states that the members hold, which have been set."""
        self.is_restored = True
        try:
            self.move_to(self.t, np.concatenate([member.states for member in self.members]))
            self.publish()
        except Discarded:
            raise SimulationError(f"{self.names}: discards the states that are set at t = {self.t:.9g} s.") from None

    # one communication step

    def step(self, t: float, h: float) -> None:
        """Go from `t` to `t + h` [s]; the first member that is stepped does it for all."""
        end = t + h
        if self.t == end or self.ended:
            return
        if self.is_restored:
            self.begin()
        if self.is_overridden or any(member.has_changed() for member in self.members):
            before = self.y
            self.event()
            if self.sensitivity and not self.ended:
                self.sensitivity.crossed(t, (before,), (self.y,))
        self.t = self.step_begin = t
        while self.t < end and not self.ended:
            self.advance(end)
        if self.sensitivity:
            self.sensitivity.publish(self)
        self.publish()

    def advance(self, end: float) -> None:
        """Take one solver step, not beyond `end` or the next event [s], and handle the event that ends it."""
        if not self.is_fresh:
            self.solver.begin(self.t, self.y, min(FIRST_STEP * self.last, end - self.t))
            self.is_fresh = True
        before, due = self.t, self.due
        if self.sensitivity:
            self.sensitivity.before(self, self.t, self.y)
        close = ROUNDING * max(abs(end), end - before)
        bound = due if due < end - close else end
        for member in self.members:  # a step across rows of an input would miss a pulse between them
            if member.followed and (row := member.followed.next_row(before + close)) < bound - close:
                bound = row
        try:
            t, y = (bound, self.y) if bound <= before else self.solver.step(bound)
            self.last = t - before
            t, y, is_event = self.located(before, t, y)
            self.move_to(t, y)
        except (SimulationError, Discarded, ValueError) as error:
            raise SimulationError(
                f"{self.names}: {self.solver_name} cannot go on at t = {before:.9g} s ({error or 'no step is accepted'}). "
                f"Use another solver, or another tolerance."
            ) from error
        if self.sensitivity:
            self.sensitivity.after(self, t - before, t, y)
        self.t, self.y = t, y
        completed = [member.complete_step() for member in self.members]
        self.ended = any(ends for _, ends in completed)
        if is_event or t >= due - close or any(event for event, _ in completed):
            self.count(end)
            self.crossed()

    def crossed(self) -> None:
        """Handle an event within the integration (state, time or step event)."""
        if self.sensitivity is None:
            self.event()
            return
        before = self.y, self.slope_before()
        self.event()
        if not self.ended:
            self.sensitivity.crossed(self.t, before, (self.y, self.differentiate(self.t, self.y)))

    def slope_before(self) -> Vector:
        """Derivatives of the states just before the event at the present time."""
        is_inside = self.step_begin <= self.last_before < self.t
        at = (self.last_before, self.solver.at(self.last_before)) if is_inside else (self.t, self.y)
        slope = self.differentiate(*at)
        self.move_to(self.t, self.y)
        return slope

    def count(self, end: float) -> None:
        """Count an event before the communication point at `end` [s]; SimulationError if events accumulate (Zeno behavior)."""
        self.events.append(self.t)
        if len(self.events) == EVENTS and self.t - self.events[0] < CLOSE * (end - self.step_begin):
            raise SimulationError(
                f"{self.names}: events follow each other without end at t = {self.t:.9g} s. "
                "Stop before, or let what comes to rest there rest."
            )

    def located(self, before: float, t: float, y: Vector) -> tuple[float, Vector, bool]:
        """Locate the end of the step: just after the first sign change of an event indicator within it, if any."""
        if not len(self.signs):
            return t, y, False
        at_high = self.indicate(t, y)
        if np.array_equal(at_high > 0, self.signs):
            return t, y, False
        low, high, at_low = before, t, self.indicators
        weight, side = 1.0, 0  # of the earlier values, by the Illinois rule: which end was moved last
        closest = ROUNDING * max(abs(t), t - before)
        while high - low > closest:
            moved = (at_high > 0) != self.signs
            rest = np.max(
                at_high[moved] / (at_high[moved] - weight * at_low[moved])
            )  # the first zero, from the end [ratio]
            middle = min(max(high - rest * (high - low), low + closest / 2), high - closest / 2)
            values = self.indicate(middle, self.solver.at(middle))
            if np.array_equal(values > 0, self.signs):
                low, at_low = middle, values
                weight, side = (2.0 * weight, -1) if side == -1 else (1.0, -1)
            else:
                high, at_high = middle, values
                weight, side = (0.5 * weight, 1) if side == 1 else (1.0, 1)
        self.last_before = low
        return high, (y if high == t else np.array(self.solver.at(high))), True

    # events

    def event(self) -> None:
        """All members through Event Mode at the present time."""
        for member in self.members:
            member.enter_event_mode()
        self.iterate()
        self.begin()

    def iterate(self) -> None:
        """Event iteration, until nothing is needed and nothing changes; then Continuous-Time Mode."""
        for member in self.members:
            member.apply()
        self.couplings.move_all()
        for _ in range(EVENT_ITERATIONS):
            updates = [member.update() for member in self.members]
            self.ended = self.ended or any(ends for _, ends, _ in updates)
            has_moved = self.couplings.move_all()
            if self.ended or not (has_moved or any(needed for needed, _, _ in updates)):
                break
        else:
            raise SimulationError(
                f"{self.names}: the event at t = {self.t:.9g} s has no end after {EVENT_ITERATIONS} iterations. "
                "Look for values that switch each other."
            )
        self.due = min(due for _, _, due in updates)
        if not self.ended:
            for member in self.members:
                member.enter_continuous_time()

    def begin(self) -> None:
        """Read the members' states and restart the solver from them."""
        self.is_fresh = self.is_restored = self.is_overridden = False
        if self.ended:
            return
        self.y = np.concatenate([member.states for member in self.members])
        self.couplings.move()
        self.indicators = np.concatenate([member.indicate() for member in self.members])
        self.signs = self.indicators > 0

    # the equations

    def move_to(self, t: float, y: Vector) -> None:
        """Be at a time [s] and in a state, with all values between the members."""
        for member, part in zip(self.members, self.parts, strict=True):
            member.move_to(t, y[part])
        self.couplings.move()

    def differentiate(self, t: float, y: Vector) -> Vector:
        """Derivatives of all states; NaN where a member cannot be evaluated."""
        try:
            self.move_to(t, y)
            return np.concatenate([member.differentiate() for member in self.members])
        except Discarded:
            return np.full(len(y), np.nan)

    def indicate(self, t: float, y: Vector) -> Vector:
        """All event indicators."""
        self.move_to(t, y)
        return np.concatenate([member.indicate() for member in self.members])

    # what others see

    def override(self, key: tuple[str, str], value: Any, element: int | None) -> None:
        """Let the other members see a value instead of a variable's own, from the next step on; None: no longer."""
        self.couplings.override(key, value, element)
        self.is_overridden = True

    def publish(self) -> None:
        """Copy the values of all members to their slots."""
        for member in self.members:
            member.publish()

    def save(self) -> tuple[float, float, float]:
        """What the members do not hold themselves."""
        return self.t, self.due, self.last

    def restore(self, saved: tuple[float, float, float]) -> None:
        """Go on from there when the members hold what they held then."""
        self.t, self.due, self.last = saved
        self.events.clear()
        self.ended, self.is_restored = False, True
