"""How long a number is, is for the drive to say: profiles are wrong, and firmware differs."""

import dataclasses

import pytest

from hw_bridge.command import hil
from hw_bridge.dictionary import I16, U8, U16, U32
from hw_bridge.hardware import HardwareKeys
from hw_bridge.plant import bench, plant
from hw_bridge.profiles import profile
from tests.hw_bridge.axis import Rig, node, wire_other_drive
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import SimulationError


def other(name, **types):
    """The profile's drive with other types, and other values, at some places."""
    known = profile(name)
    changed = {tuple(int(part, 16) for part in key.strip("_").split("_")): more for key, more in types.items()}
    objects = tuple(dataclasses.replace(one, **changed.get((one.index, one.sub), {})) for one in known.objects)
    return dataclasses.replace(known, objects=objects)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("mclm", {"_2350_4": {"type": U32}, "_2338_2": {"type": U8}, "_2321_2": {"type": U32}}),
        ("mclm", {"_2350_4": {"type": U16}, "_6083_0": {"type": U16}}),
        ("faulhaber_v3", {"_6007_0": {"type": U8}, "_6085_0": {"type": U16}}),
        ("epos4", {"_605A_0": {"type": U8, "high": None}, "_60C2_1": {"type": U16}}),
    ],
)
def test_other_sizes_than_in_the_profile(build, monkeypatch, name, types):
    wire_other_drive(monkeypatch, plant, other(name, **types))
    rig = Rig(build, {"servomotor": NODES[name]})
    rig.set(target_velocity=0.02)
    rig.go(500)
    assert rig.get("position") == pytest.approx(0.01, rel=0.25)
    if name == "mclm":
        assert rig.drive.dictionary.get(0x2350, 4) == 24


def test_a_value_that_does_not_fit_is_refused(build, monkeypatch):
    wire_other_drive(monkeypatch, plant, other("mclm", _2321_2={"type": U8}))
    rig = Rig(build, {"servomotor": node("mclm")})
    with pytest.raises(SimulationError, match=r"2321h\.2 cannot hold 31710: it has 1 bytes, unsigned"):
        rig.go(1)


def test_a_negative_number_keeps_its_sign(build, monkeypatch):
    wire_other_drive(monkeypatch, plant, other("mclm", _607D_1={"type": I16}, _607D_2={"type": I16}))
    rig = Rig(build, {"servomotor": node("mclm", limits={"position": ["-20 mm", "20 mm"]})})
    rig.go(1)
    assert rig.drive.dictionary.get(0x607D, 1) == -24000


def test_a_drive_that_does_not_tell_sizes(build, monkeypatch):
    """Expedited answers without a size: then the profile's counts."""
    rig = Rig(build, {"servomotor": node()})
    rig.go(1)
    client = rig.master.nodes["servomotor"].sdo
    answer = rig.drive.sdo.answer
    monkeypatch.setattr(rig.drive.sdo, "answer", lambda request: unsized(answer(request)))
    setup = pytest.importorskip("hw_bridge.master.setup")
    found = rig.master.nodes["servomotor"]
    found.sizes.clear()
    setup.write(found, 0x6007, 0, 2)
    assert not client.sized
    assert rig.drive.dictionary.get(0x6007) == 2


def unsized(answer):
    return bytes([0x42]) + answer[1:] if answer[0] & 0xE3 == 0x43 else answer


def test_the_check_tells_sizes_and_what_is_refused(build, monkeypatch, capsys):
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"servomotor": node("mclm", objects={"2FFFh": 1})}})
    wire_other_drive(monkeypatch, bench, other("mclm", _2338_2={"type": U32}))
    hil.compare_bus(keys, build).show()
    first, *others = capsys.readouterr().out.partition("differs: ")[2].replace("\n  ", " ").splitlines()
    assert "2FFFh.0: refused with 06020000h, no object. A run writes it." in first  # above all else
    assert "note: servomotor: 2338h.2 has 4 bytes, in the profile 2." in others


def test_sizes_of_the_mclm_are_those_of_its_vendor():
    types = {(one.index, one.sub): one.type for one in profile("mclm").objects}
    assert types[0x2350, 4] is U8
    places = [(0x2331, 1), (0x2331, 2), (0x2332, 1), (0x2332, 2), (0x2333, 3), (0x2338, 1), (0x2338, 2), (0x2338, 3)]
    assert {types[place] for place in places} == {U16}


@pytest.mark.parametrize("more", [{}, {"product": 0x68500000}])
def test_an_epos4_micro_is_another_drive(build, monkeypatch, more):
    wire_other_drive(monkeypatch, plant, other("epos4", _1018_2={"default": 0x68500000}))
    rig = Rig(build, {"servomotor": {**NODES["epos4"], **more}})
    with pytest.raises(
        SimulationError,
        match=r"node 1 is a maxon EPOS4 Micro 24/5\. No profile fits it\. It has another dictionary than an EPOS4",
    ):
        rig.go(1)
    assert (
        hil.profile_title_of(0xFB, 0x68500000)
        == "maxon EPOS4 Micro 24/5, which no profile fits. It has another dictionary than an EPOS4. Use another drive."
    )
