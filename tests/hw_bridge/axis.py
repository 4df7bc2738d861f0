"""A bridge with simulated drives, driven by hand: no scenario around it."""

from pathlib import Path

from fmus.servomotor.model import Servomotor

from hw_bridge.bridge.hardware import Hardware
from hw_bridge.device import Drive
from hw_bridge.hardware import HardwareKeys

MILLISECOND = 1_000_000
H = 1e-3


UNSTATED = {"faulhaber_v3": {"acceleration": "1 mm/s^2"}}  # units that no object of a drive states


def with_units(profile):
    """The profile and its units as they stand in a hardware file, in a flow mapping."""
    units = UNSTATED.get(profile)
    return f"{profile}, units: {{acceleration: {units['acceleration']}}}" if units else profile


def node(profile="faulhaber_v3", number=1, **more):
    stated = {"units": UNSTATED[profile]} if profile in UNSTATED else {}
    return {"node": number, "profile": profile, **stated, **more}


def wire_other_drive(monkeypatch, module, profile):
    """Let a bench of `module` (hw_bridge.plant.plant or bench) have a simulated drive that is not what the file says."""
    monkeypatch.setattr(module, "Drive", lambda _, number, motor: Drive(profile, number, motor))


class Rig:
    """Axes of one simulated bench, all stepped together by 1 ms."""

    def __init__(self, build, nodes, member=Servomotor, **more):
        known = isinstance(nodes, HardwareKeys)
        keys = nodes if known else HardwareKeys.model_validate({"simulated": True, "nodes": nodes, **more})
        self.hardware = Hardware(Path("bench.yaml"), keys, build=build)
        self.axes = {name: self.hardware._component(name, member)() for name in keys.nodes}
        self.session = self.hardware.present
        self.t = 0
        for axis in self.axes.values():
            axis.start()

    @property
    def axis(self):
        return next(iter(self.axes.values()))

    @property
    def plant(self):
        return next(iter(self.session.bench.plants.values()))

    @property
    def drive(self):
        return self.plant.drive

    @property
    def master(self):
        return self.session.master

    def go(self, milliseconds):
        for _ in range(milliseconds):
            for axis in self.axes.values():
                axis.advance(self.t / 1000, H)
            self.t += 1

    def set(self, **values):
        for name, value in values.items():
            self.axis.views[name][...] = value

    def get(self, name):
        return float(self.axis.views[name])
