"""A motor that follows its command exactly, so that every value of a drive can be calculated by hand."""

from hw_bridge.bus import MILLISECOND, EventQueue
from hw_bridge.device import Drive
from hw_bridge.device.axis import Axis
from hw_bridge.dictionary import Dictionary
from hw_bridge.profiles import MOTORS, profile


class IdealMotor:
    """Position [m or rad], velocity, current [A] and supply [V] are attributes; `calls` are the commands of the drive."""

    def __init__(self, model=MOTORS["lm2070"].model, position=0.0):
        self.model = model
        self.measured_position = position
        self.measured_velocity = self.current = 0.0
        self.supply = 24.0
        self.strongest = 2.0
        self.powered = False
        self.tuned = {}
        self.calls = []

    @property
    def position(self):
        return self.measured_position

    def set(self, name, value):
        assert name == "supply_voltage"
        self.supply = value

    def tune(self, name, factor):
        self.tuned[name] = factor

    def off(self):
        self.powered = False
        self.calls.append(("off",))

    def follow_position(self, position, limit, velocity=0.0, current=0.0):
        self._command("position", position, limit, velocity, current)

    def follow_velocity(self, velocity, limit, current=0.0):
        self._command("velocity", velocity, limit, current)

    def follow_current(self, current, limit):
        self._command("current", current, limit)

    def _command(self, *call):
        self.powered = True
        self.calls.append(call)

    def advance(self, _time):
        """Be where the last command wants to be after a control cycle of 1 ms."""
        kind, *values = self.calls[-1] if self.calls else ("off",)
        before = self.measured_position
        if kind == "position":
            self.measured_position = values[0]
        elif kind == "velocity":
            self.measured_position += values[0] * 1e-3
        self.measured_velocity = values[0] if kind == "velocity" else (self.measured_position - before) * 1e3
        self.current = values[0] if kind == "current" else 0.0


def axis(name="faulhaber_v3", lacks=(), **values):
    """An axis with an ideal motor; `values`: of objects, as `x607D_1=-5`."""
    described = profile(name)
    dictionary = Dictionary(described.objects, 1)
    for index in lacks:
        dictionary.remove(index)
    for key, value in values.items():
        index, _, sub = key[1:].partition("_")
        assert (int(index, 16), int(sub or 0)) in dictionary.values, key
        dictionary.values[int(index, 16), int(sub or 0)] = value
    return Axis(described, dictionary, EventQueue(), IdealMotor(described.motor))


class Turned:
    """A drive with an ideal motor, commanded through its dictionary, without a bus."""

    def __init__(self, name="faulhaber_v3", **values):
        described = profile(name)
        self.motor = IdealMotor(described.motor)
        self.drive = Drive(described, 1, self.motor)
        self.sent = []
        self.drive.connect(self.sent.append)
        self.go(110)
        for key, value in values.items():
            index, _, sub = key[1:].partition("_")
            self.write(int(index, 16), value, int(sub or 0))

    def go(self, milliseconds):
        self.drive.advance(self.drive.now + milliseconds * MILLISECOND)

    def write(self, index, value, sub=0):
        dictionary = self.drive.dictionary
        dictionary.write(dictionary.entry(index, sub), value)

    def read(self, index, sub=0):
        return self.drive.dictionary.get(index, sub)

    def enable(self, mode):
        self.write(0x6060, mode)
        self.go(1)
        for word in (0x06, 0x07, 0x0F):
            self.write(0x6040, word)
        return self

    @property
    def bits(self):
        """Bits 10 to 13 of the statusword as text, such as `10 12`."""
        word = self.read(0x6041)
        return " ".join(str(bit) for bit in range(10, 14) if word >> bit & 1)
