"""A member whose every answer a test decides: it steps, refuses, comes back early, ends the run, cannot go back."""

import ctypes

import numpy as np

from twin.compiler import machine
from twin.coupling import Member, MemberVariable, StateAccess

OK, DISCARD, ERROR = 0, 2, 3


def scalar(name, causality):
    return MemberVariable(name, causality, "continuous", "Float64", np.dtype(np.float64), unit="m")


class Mock(Member):
    """y follows u with a time constant of 0.1 s, by explicit Euler; `steps`: begin and length of all that were made.

    `early`: times at which a step over them comes back. `discards`: FMI 2.0's way to do the same, and then the time
    is asked for. `ends`: when it wants the run to end. `forgets`: it says that it goes back and does not.
    `longest`, `shortest`: steps beyond are an ERROR. `talks`: a log line for each step.
    """

    def __init__(self, name, early=(), discards=(), ends=None, forgets=False, longest=1.0, shortest=0.0, talks=False):
        self.name, self.log, self.identity = name, [], {"kind": "mock"}
        self.variables = {v.name: v for v in (scalar("u", "input"), scalar("y", "output"), scalar("t", "output"))}
        self.memory = np.zeros(8)  # u, y, t
        self.instance = int(self.memory.ctypes.data)
        self.returns, self.discards, self.ends, self.forgets = early, discards, ends, forgets
        self.longest, self.shortest, self.talks = longest, shortest, talks
        self.steps, self.came, self.reason = [], 0.0, ""
        self.has_cheap_fmu_state = self.has_fmu_state = not forgets
        self.may_return_early = bool(early)
        self._step = machine.STEP(self.step)
        self.step_function = ctypes.cast(self._step, ctypes.c_void_p).value

    def step(self, _instance, t, h, _prior, _event, terminate, early, last):
        if self.talks:
            self.log.append(f"step from {t:g} by {h:g}")
        if not self.shortest <= h <= self.longest:
            return ERROR
        for times, discards in ((self.returns, False), (self.discards, True)):
            at = next((at for at in times if t + 1e-9 < at < t + h - 1e-9), None)
            if at is not None:
                self.came, self.reason = at, ""
                if discards:
                    return DISCARD
                h = at - t
                ctypes.c_bool.from_address(early).value = True
        if self.ends is not None and t + h > self.ends - 1e-9:
            ctypes.c_bool.from_address(terminate).value = True
        self.steps.append((t, h))
        self.memory[1] += h / 0.1 * (self.memory[0] - self.memory[1])
        self.memory[2] = t + h
        ctypes.c_double.from_address(last).value = t + h
        return OK

    def instantiate(self):
        pass

    def enter_initialization(self, t, stop):
        self.memory[2] = t

    def exit_initialization(self):
        pass

    def set(self, name, value):
        self.memory[list(self.variables).index(name)] = value

    def get(self, name):
        return self.memory[list(self.variables).index(name)]

    def address(self, name):
        return self.instance + 8 * list(self.variables).index(name)

    def access(self, names, write):
        raise NotImplementedError

    def state_access(self, count):
        if self.forgets:
            self.saved = ctypes.c_void_p()
            self._way = [machine.STATE(lambda *_: OK) for _ in range(2)]
            called = [ctypes.cast(one, ctypes.c_void_p).value for one in self._way]
            return StateAccess(get=called[0], set=called[1], pointer_addresses=(ctypes.addressof(self.saved),) * count)
        return StateAccess(self.instance, len(self.memory))

    def save(self):
        return self.memory.copy()

    def restore(self, saved):
        self.memory[:] = saved

    def last_successful_time(self, reached):
        return self.came

    def close(self):
        pass


class Liar(Mock):
    """Says of itself that it goes back, as somebody else's FMU does."""

    def __init__(self, name):
        super().__init__(name, forgets=True)
        self.has_fmu_state = True


class Taker(Mock):
    """Takes derivatives of its input, and then integrates exactly what it is told: y' = (u - y) / 0.1 s."""

    def __init__(self, name):
        super().__init__(name)
        self.variables["u"] = MemberVariable(
            "u", "input", "continuous", "Float64", np.dtype(np.float64), unit="m", references=(7,)
        )
        self.slope = [0.0, 0.0]
        self._take = machine.ACCESS(self.take)

    def input_derivatives(self):
        return ctypes.cast(self._take, ctypes.c_void_p).value

    def take(self, _instance, references, count, orders, values):
        for i in range(count):
            assert ctypes.c_uint.from_address(references + 4 * i).value == 7
            order = ctypes.c_int.from_address(orders + 4 * i).value
            self.slope[order - 1] = ctypes.c_double.from_address(values + 8 * i).value
        return OK

    def step(self, _instance, t, h, *rest):
        first, second = self.slope
        n = 20
        for i in range(n):  # the classical Runge-Kutta method

            def rate(s, y):
                return (self.memory[0] + first * s + second * s * s / 2 - y) / 0.1

            s, d, y = i * h / n, h / n, self.memory[1]
            a = rate(s, y)
            b = rate(s + d / 2, y + d / 2 * a)
            c = rate(s + d / 2, y + d / 2 * b)
            self.memory[1] += d / 6 * (a + 2 * b + 2 * c + rate(s + d, y + d * c))
        self.memory[2] = t + h
        ctypes.c_double.from_address(rest[-1]).value = t + h
        return OK
