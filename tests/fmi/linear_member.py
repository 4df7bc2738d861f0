"""A linear member for the solvers of Model Exchange, without an FMU: der(x) = A x + B u + E p, y = C x + D u + F p."""

import numpy as np

from twin.coupling import MemberVariable, ResolvedConnection
from twin.coupling.system import Reference
from twin.fmi.importing.local_state import VariableSlot
from twin.fmi.model_description import Continuous

X, DER_X, U, Y, P = range(5)  # value references


def real(name, causality, reference, size, variability="continuous"):
    """A variable of real numbers, a scalar if there is one."""
    shape = () if size == 1 else (size,)
    return MemberVariable(name, causality, variability, "Float64", np.dtype(float), shape, references=(reference,))


class LinearMember:
    """As many rows and columns as the matrices have; `start`: states; `level`: an event where the first state passes it."""

    solver, tolerance, begin, sensitivity = "", None, 0.0, None

    def __init__(self, name, a, b=(), c=(), d=None, e=None, f=None, p=(), start=None, level=None):
        a, b, c = (np.atleast_2d(np.asarray(one, float)) for one in (a, b, c))
        n, self.p = len(a), np.asarray(p, float)
        b, c = b.reshape(n, b.size // n if n else 0), c.reshape(c.size // n if n else len(c), n)
        m, k, q = b.shape[1], len(c), len(self.p)
        d, e, f = (np.zeros(shape) if one is None else np.reshape(one, shape).astype(float)
                   for one, shape in ((d, (k, m)), (e, (n, q)), (f, (k, q))))  # fmt: off
        self.name, self.blocks = name, {DER_X: {X: a, U: b, P: e}, Y: {X: c, U: d, P: f}}
        self.u, self.level, self.reset = np.zeros(m), level, None
        self.states = np.array(np.zeros(n) if start is None else start, float)
        self.nominals = np.ones(n)
        self.capabilities = {"providesDirectionalDerivatives": True}
        self.structure = Continuous((X,) if n else (), (DER_X,) if n else (), 0, False)
        kinds = {"x": ("local", X, n), "der(x)": ("local", DER_X, n), "u": ("input", U, m), "y": ("output", Y, k),
                 "p": ("parameter", P, q)}  # fmt: off
        self.variables = {key: real(key, *rest) for key, rest in kinds.items() if rest[2]}
        self.variables["n"] = real("n", "output", 9, 1, "discrete")
        self.slots, self.due, self.ends, self.log = {}, np.inf, False, []

    # equations

    def result(self, unknown):
        """The values of an unknown at the present point."""
        knowns = {X: self.states, U: self.u, P: self.p}
        return sum((block @ knowns[known] for known, block in self.blocks[unknown].items()), np.zeros(1))

    def move_to(self, t, states):
        self.t, self.states[:] = t, states

    def differentiate(self):
        return self.result(DER_X)

    def indicate(self):
        return np.zeros(0) if self.level is None else self.states[:1] - self.level

    def direction(self, unknowns, reference, seed, rows):
        columns = np.concatenate([self.blocks[int(unknown)][reference] @ seed for unknown in unknowns])
        assert len(columns) == rows
        return columns

    # values

    def slot(self, name):
        variable = self.variables[name]
        if name not in self.slots:
            values = np.zeros(variable.size)
            self.slots[name] = VariableSlot(variable, variable.causality == "input", values, values.copy())
        return self.slots[name]

    def move(self, slot):
        if slot.is_input:
            self.u[:] = slot.values
        else:
            slot.values[:] = self.result(Y)

    def publish(self):
        for slot in self.slots.values():
            if not slot.is_input:
                self.move(slot)

    # events: `reset` takes the states there, `due` is the time of the next time event [s]

    def enter_event_mode(self):
        self.log.append(self.t)
        if self.reset is not None:
            self.states[:] = self.reset(self.states)

    def apply(self):
        for slot in self.slots.values():
            if slot.has_changed:
                self.move(slot)
                slot.applied[:] = slot.values

    def update(self):
        return False, self.ends, self.due

    def enter_continuous_time(self):
        pass

    def complete_step(self):
        return False, self.ends

    def has_changed(self):
        return any(slot.has_changed for slot in self.slots.values())


def link(source, target, factor=1.0, offset=0.0, first=0, size=None, to=0):
    """A connection of (member, variable) with another, of `size` elements from `first` and `to` on."""
    whole = source[0].variables[source[1]]
    size = whole.size if size is None else size
    ends = (Reference(one.name, one.variables[name], at, size) for (one, name), at in ((source, first), (target, to)))
    return ResolvedConnection(*ends, factor=factor, offset=offset)
