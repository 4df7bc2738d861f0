"""Rules of CiA 301 (version 4.2.0): EMCY, the objects of a device, its parameters.

The numbers of clauses are recalled; the service or object beside them counts. What a vendor's drive does not offer is skipped.
"""

import struct

import pytest

from hw_bridge.dictionary import Code, Mode
from tests.hw_bridge.bench import NODE
from tests.hw_bridge.device.conformance.motions import PROFILES
from tests.hw_bridge.device.conformance.service_requests import (
    ERROR,
    LOAD,
    SAVE,
    abort,
    valued,
)


@pytest.fixture(params=PROFILES)
def name(request):
    """Every profile: errors and what is stored differ."""
    return request.param


# ---------------------------------------------------------------------------------------------------------- EMCY


def test_an_emergency_has_code_register_and_8_bytes(bench):
    """7.2.7.3.1, protocol EMCY write."""
    code = ERROR[bench.profile.name]
    bench.drive.inject(code)
    bench.go(2)
    (data,) = bench.frames(0x80 + NODE)
    assert (len(data), struct.unpack_from("<H", data)[0]) == (8, code)
    assert data[2] == bench.read(0x1001)


def test_the_error_register_tells_a_generic_error_with_every_error(bench):
    """7.5.2.2, 1001h: bit 0 at any error situation."""
    missing = []
    for code in bench.profile.faults:
        bench.drive.inject(code)
        if not bench.drive.dictionary.get(0x1001) & 1:
            missing.append(f"{code:04X}")
        bench.drive.power_on()
    assert missing == []


def test_the_error_register_tells_an_error_that_is_masked(make):
    """7.5.2.2, 1001h: also where the vendor's mask keeps the EMCY back."""
    bench = make("mclm")
    bench.write(0x2321, 0, 1)
    bench.drive.inject(ERROR["mclm"])
    bench.go(1)
    assert bench.emergencies() == []
    assert bench.read(0x1001) & 1


def test_the_error_register_keeps_what_is_left(bench):
    """7.2.7.1, emergency state transitions: of two errors one is gone."""
    bench.drive.inject(0x8611)
    bench.drive.inject(0x3210, lasting=True)
    bench.go(1)
    bench.go(200)
    bench.control(0x00, 0x80)
    assert bench.drive.active.keys() == {0x3210}
    assert bench.read(0x1001) == bench.profile.faults[0x3210].register | 1


def test_the_end_of_errors_is_told(bench):
    """7.2.7.1: error code 0000h, register 0."""
    bench.drive.inject(ERROR[bench.profile.name])
    bench.go(300)
    bench.frames(0x80 + NODE)
    bench.control(0x00, 0x80)
    bench.go(2)
    assert bench.frames(0x80 + NODE) == [bytes(8)]
    assert bench.read(0x1001) == 0


def test_the_history_has_the_newest_first(bench):
    """7.5.2.4, 1003h."""
    bench.drive.inject(0x8611)
    bench.drive.inject(0x3210)
    bench.go(2)
    assert bench.read(0x1003) == 2
    assert [bench.read(0x1003, sub) & 0xFFFF for sub in (1, 2)] == [0x3210, 0x8611]


def test_the_history_is_cleared_by_0_only(bench):
    """7.5.2.4: other values 06090030h, subindices are read only."""
    bench.drive.inject(0x8611)
    bench.go(2)
    assert abort(bench.write, 0x1003, 1) is Code.VALUE_RANGE
    assert abort(bench.write, 0x1003, 0, 1) is Code.READ_ONLY
    bench.write(0x1003, 0)
    assert bench.read(0x1003) == 0


def test_an_empty_history_has_no_entries(bench):
    """7.5.2.4: 08000024h or 08000000h where no error is present."""
    assert bench.read(0x1003) == 0
    assert abort(bench.read, 0x1003, 1) is Code.NO_DATA
    bench.drive.inject(0x8611)
    bench.go(2)
    bench.read(0x1003, 1)
    assert abort(bench.read, 0x1003, 2) is Code.NO_DATA


def test_the_identifier_of_an_emergency(bench):
    """7.5.2.17, 1014h: the default, and no change while in use."""
    assert bench.read(0x1014) == 0x80 + NODE
    assert abort(bench.write, 0x1014, 0x93) in (Code.VALUE_RANGE, Code.READ_ONLY)


# -------------------------------------------------------------------------------------------- device, parameters


def test_mandatory_objects(bench):
    """7.4.2: 1000h, 1001h, 1018h and one kind of error control."""
    assert {0x1000, 0x1001, 0x1017, 0x1018} <= bench.drive.dictionary.objects.keys()


def test_the_device_profile_is_402(bench):
    """7.5.2.1, 1000h: the profile's number in bits 0 to 15."""
    assert bench.read(0x1000) & 0xFFFF == 402


def test_the_identity(bench):
    """7.5.2.21, 1018h: 1 to 4 subindices, a vendor."""
    assert 1 <= bench.read(0x1018) <= 4
    assert bench.read(0x1018, 1) != 0


@pytest.mark.parametrize(("index", "signature"), [(0x1010, SAVE), (0x1011, LOAD)])
def test_signatures(bench, index, signature):
    """7.5.2.13 and 7.5.2.14: 1010h and 1011h."""
    assert bench.read(index, 1) & 1
    assert abort(bench.write, index, 0x12345678, 1) is Code.CANNOT_STORE
    bench.write(index, signature, 1)
    assert bench.read(index, 1) & 1


def test_defaults_act_at_the_next_reset(bench):
    """7.5.2.14, 1011h."""
    default, value = bench.read(0x6081), valued(bench, 0x6081)
    bench.write(0x6081, value)
    bench.write(0x1010, SAVE, 1)
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == value
    bench.write(0x1011, LOAD, 1)
    assert bench.read(0x6081) == value
    bench.nmt(129)
    bench.go(150)
    assert bench.read(0x6081) == default


def test_the_mode_may_be_written_in_every_state_of_nmt_that_has_sdo(bench):
    """7.3.2.2.5: SDO in Pre-operational and Operational."""
    for command in (128, 1):
        bench.nmt(command)
        bench.write(0x6060, Mode.PV)
        bench.go(2)
        assert bench.read(0x6061) == Mode.PV
