"""A drive, a bus in simulated time and a master that says what a test tells it."""

import struct

from hw_bridge.bus import MILLISECOND, Bus, Frame
from hw_bridge.bus.recorder import Recorder
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import Code, Mode, State, state_of
from hw_bridge.profiles import profile

NODE = 3


class AbortedError(Exception):
    """The drive refused with this code."""

    def __init__(self, code):
        super().__init__(f"{code:08X}")
        self.code = Code(code)


class Master(Recorder):
    """A recorder that is on a bus."""

    def __init__(self, bus):
        super().__init__()
        bus.attach(self)


class Bench:
    """One drive of a profile in Pre-operational, with short words for what a master does."""

    def __init__(self, name, build, node=NODE):
        self.profile = profile(name)
        self.node = node
        self.drive = Drive(self.profile, node, Motor(self.profile.motor, build=build))
        self.bus = Bus()
        self.master = Master(self.bus)
        self.bus.attach(self.drive)
        self.go(110)

    def go(self, milliseconds):
        self.bus.advance(self.bus.now + round(milliseconds * MILLISECOND))

    def send(self, identifier, data=b"", **more):
        self.master.send(Frame(identifier, bytes(data), **more))
        self.go(0.5)

    def frames(self, identifier):
        """Data of all frames heard with an identifier, and forget them."""
        found = [frame.data for _, frame in self.master.received if frame.id == identifier]
        self.master.received = [one for one in self.master.received if one[1].id != identifier]
        return found

    def sdo(self, request):
        self.frames(0x580 + self.node)
        self.send(0x600 + self.node, request.ljust(8, b"\0"))
        self.go(2)
        (answer,) = self.frames(0x580 + self.node)
        if answer[0] == 0x80:
            raise AbortedError(struct.unpack_from("<I", answer, 4)[0])
        return answer

    def write(self, index, value, sub=0):
        entry = self.drive.dictionary.objects.get(index, {}).get(sub)
        data = entry.encode(value) if entry else struct.pack("<I", value)
        self.sdo(struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub) + data)

    def read(self, index, sub=0):
        answer = self.sdo(struct.pack("<BHB", 0x40, index, sub))
        return self.drive.dictionary.entry(index, sub).decode(answer[4 : 8 - (answer[0] >> 2 & 3)])

    def nmt(self, command):
        self.send(0x000, [command, self.node])

    def control(self, *words):
        for word in words:
            self.write(0x6040, word)

    def enable(self, mode=Mode.PP):
        self.write(0x6060, mode)
        self.control(0x06, 0x07, 0x0F)
        assert self.state is State.ENABLED

    @property
    def word(self):
        return self.drive.dictionary.get(0x6041)

    @property
    def state(self):
        assert state_of(self.word) is self.drive.state
        return self.drive.state

    def emergencies(self):
        """Codes of the EMCY messages heard."""
        return [struct.unpack_from("<H", data)[0] for data in self.frames(0x80 + self.node)]
