"""What a master reads of a drive before a run, and how it leaves it: objects, identity, faults, scales, release."""

from dataclasses import replace

import pytest

from hw_bridge.dictionary import Mode, State
from hw_bridge.master import setup
from hw_bridge.master.presence import OPTIONAL, REQUIRED, learn_objects
from hw_bridge.master.scaling import learn_scaling, unknown_scale, wrong_motor
from hw_bridge.profiles import identity
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node


def missing(findings):
    """Indices of the objects that are named as missing, in notes and in problems."""
    return [
        {int(text.split("has no ")[1][:4], 16) for text in texts if "has no 6" in text or "has no 1" in text}
        for texts in findings
    ]


@every_case("index", OPTIONAL)
def test_an_optional_object_is_left_out_with_a_note(index):
    node = unconnected_node(missing=[index])
    found = learn_objects(node)
    assert missing(found) == [{index}, set()]
    assert index not in node.mirror
    assert node.absent == {index}


@every_case("index", REQUIRED)
def test_a_required_object_is_a_problem(index):
    found = learn_objects(unconnected_node(missing=[index]))
    assert missing(found) == [set(), {index}]


def test_objects_of_homing_are_required_only_for_homing():
    assert missing(learn_objects(unconnected_node(missing=[0x6098, 0x6099]))) == [set(), set()]
    homing = {"method": 37}
    assert missing(learn_objects(unconnected_node(missing=[0x6098, 0x6099], homing=homing))) == [
        set(),
        {0x6098, 0x6099},
    ]


def modes(*offered):
    """6502h."""
    return sum(1 << mode - 1 for mode in offered)


@every_case(
    ("offered", "keys", "notes", "problems"),
    [
        ((Mode.CSP, Mode.CSV), {}, [], []),
        ((Mode.PP, Mode.PV), {}, [], []),
        (
            (Mode.CSP,),
            {},
            [
                "axis: has neither csv nor pv (6502h is 80h): a member that is told speeds needs `follow: {mode: csp}`, and a contact ends a run without a retraction."
            ],
            [],
        ),
        ((Mode.CSV,), {}, [], ["axis: has neither csp nor pp (6502h is 100h): it cannot be held at a position."]),
        (
            (Mode.CSP, Mode.CSV),
            {"homing": {"method": 37}},
            [],
            ["axis: has no homing mode (6502h is 180h): leave `homing` out."],
        ),
        ((Mode.CSP, Mode.CSV, Mode.HM), {"homing": {"method": 37}}, [], []),
    ],
)
def test_modes_that_a_drive_offers(offered, keys, notes, problems):
    node = unconnected_node(values={(0x6502, 0): modes(*offered)}, **keys)
    found = learn_objects(node)
    assert (found.notes, found.problems) == (notes, problems)
    assert node.mode is (Mode.CSV if not notes else Mode.CSP)  # it holds its place where it has no velocity mode


def test_a_force_needs_cst():
    node = unconnected_node(values={(0x6502, 0): modes(Mode.CSP, Mode.CSV)})
    node.has_target_force = True
    assert learn_objects(node).problems == ["axis: is told a force, but has no cst: 6502h is 180h. Use another drive."]


def test_modes_of_the_profile_where_a_drive_does_not_list_them():
    node = unconnected_node(missing=[0x6502])
    learn_objects(node)
    assert [mode for mode in Mode if mode and node.offers(mode)] == [
        Mode.PP,
        Mode.PV,
        Mode.HM,
        Mode.CSP,
        Mode.CSV,
        Mode.CST,
    ]


def test_velocity_modes_need_a_target_velocity():
    found = learn_objects(unconnected_node(missing=[0x60FF]))
    assert found.problems == ["axis: has no 60FFh Target velocity: its velocity modes (6502h is 3A5h) cannot be used."]


@every_case(
    ("lost", "problems"),
    [
        (0x1401, ["axis: it has no RPDO 2 (1401h), which a run needs."]),
        (0x1600, ["axis: it has no RPDO 1 (1400h), which a run needs."]),
        (0x1801, ["axis: it has no TPDO 2 (1801h), which a run needs."]),
        (0x1402, []),
        (0x1803, []),  # a run without a force needs neither
        (
            0x6077,
            [
                "axis: it tells no current (6077h, 6078h): limits.force cannot be watched. Add `watch_force: false` if something else bounds the force."
            ],
        ),
    ],
)
def test_process_data_that_a_run_needs(lost, problems):
    node = unconnected_node(missing=[lost, *([0x6078] if lost == 0x6077 else [])])
    assert learn_objects(node).problems == problems


def test_mapping_entries_that_a_run_needs():
    node = unconnected_node()
    entries = node.mirror.objects[0x1A00]
    for sub in [sub for sub in entries if sub > 2]:
        del entries[sub]
    assert learn_objects(node).problems == ["axis: TPDO 1 has room for 2 objects, a run needs 3."]
    node = unconnected_node(missing=[0x6077, 0x6078], watch_force=False)
    assert learn_objects(node).problems == []
    node = unconnected_node(missing=[0x60FE], safe_outputs=0)
    assert learn_objects(node).problems == [
        "axis: it has no 60FEh Digital outputs: leave outputs and safe_outputs out."
    ]


PRODUCT, PRODUCT_OF_MCLM = (identity(name)[2] for name in ("faulhaber_v3", "mclm"))


@every_case(
    ("values", "keys", "text"),
    [
        ({}, {}, ""),
        ({(0x1000, 0): 0x30191}, {}, "axis: node 3 is no drive: 1000h is 00030191h. Check the node-ID."),
        (
            {(0x1018, 1): 0x123},
            {},
            "axis: node 3: vendor is 123h, expected 147h (FAULHABER Motion Control V3.0). Correct the hardware file or the wiring.",
        ),
        (
            {(0x1018, 2): 0x22},
            {"product": 0x21},
            "axis: node 3: product code is 22h, expected 21h (FAULHABER Motion Control V3.0). Correct the hardware file or the wiring.",
        ),
        ({(0x1018, 2): 0x22, (0x1018, 3): PRODUCT_OF_MCLM}, {}, ""),  # any product that is no other profile's
        (
            {(0x1018, 2): PRODUCT_OF_MCLM},
            {},
            f"axis: node 3: product code is {PRODUCT_OF_MCLM:X}h, expected {PRODUCT:X}h (FAULHABER Motion Control V3.0). Correct the hardware file or the wiring.",
        ),
        (
            {(0x1018, 4): 7},
            {"serial": 8},
            "axis: node 3: serial number is 7h, expected 8h (FAULHABER Motion Control V3.0). Correct the hardware file or the wiring.",
        ),
        ({(0x1018, 4): 7}, {"serial": 7}, ""),
    ],
)
def test_identity_of_a_drive(values, keys, text):
    node = unconnected_node(values=values, **keys)
    assert setup.identify(node) == ([text] if text else [])


@every_case(
    ("word", "values", "text"),
    [
        (WORDS[State.ENABLED], {(0x603F, 0): 0x4310}, ""),
        (WORDS[State.FAULT], {}, "axis: is in Fault, and does not say why."),
        (WORDS[State.FAULT], {(0x603F, 0): 0x4310}, "axis: is in Fault, 603Fh: 4310h temperature."),
        (WORDS[State.REACTION], {(0x603F, 0): 0x1234}, "axis: is in Fault, 603Fh: 1234h."),
        (
            WORDS[State.FAULT],
            {(0x1003, 0): 2, (0x1003, 1): 0xFFFF8611, (0x1003, 2): 0x4310, (0x1003, 3): 0x3210},
            "axis: is in Fault, 1003h: 8611h following error, 4310h temperature.",
        ),
    ],
)
def test_the_error_of_a_drive_in_fault(word, values, text):
    assert setup.faults(unconnected_node(values={(0x6041, 0): word, **values})) == text


def test_a_fault_is_reset_by_an_edge():
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    assert setup.reset(node) is State.DISABLED
    assert node.server.written == [(0x6040, 0, 0), (0x6040, 0, 0x80), (0x6040, 0, 0)]


@pytest.mark.parametrize(
    ("state", "released"),
    [(State.DISABLED, True), (State.FAULT, True), (State.ENABLED, False), (State.QUICK_STOP, False)],
)
def test_the_heartbeat_is_expected_until_a_drive_is_at_rest(state, released):
    """Only what this program wrote is cleared."""
    node = unconnected_node(values={(0x6041, 0): WORDS[state], (0x60B1, 0): 4}, follow={"feedforward": 1.0})
    setup.write(node, 0x1016, 1, 127 << 16 | 60)
    setup.write(node, 0x1017, 0, 20)
    node.server.written.clear()
    assert setup.release(node) is state
    heartbeats = [(0x1016, 1, 0), (0x1017, 0, 0)]
    assert node.server.written == [(0x6040, 0, 0), *([(0x60B1, 0, 0), *heartbeats] if released else [])]
    other = unconnected_node(values={(0x6041, 0): WORDS[state], (0x1016, 1): 5, (0x1017, 0): 5})
    setup.release(other)
    assert other.server.written == [(0x6040, 0, 0)]


def test_outputs_are_made_safe_where_the_file_has_levels():
    node = unconnected_node()
    setup.make_safe(node)
    assert node.server.written == []
    node = unconnected_node(safe_outputs=5)
    setup.make_safe(node)
    assert node.server.written == [(0x60FE, 1, 5)]


@pytest.mark.parametrize(
    ("polarity", "text"),
    [
        (0, ""),
        (0xC0, ""),
        (0x80, "607Eh is 80h: positions are reversed, velocities are not"),
        (0x40, "607Eh is 40h: velocities are reversed, positions are not"),
    ],
)
def test_a_polarity_of_one_kind_alone_is_not_moved(polarity, text):
    node = unconnected_node(values={(0x607E, 0): polarity})
    learn_scaling(node)
    assert node.own.assumed == ([text] if text else [])
    ending = "It is not moved. Give what is missing under `units`, `motor` or `scaling` in the hardware file."
    assert unknown_scale(node) == (f"axis: its scale is ASSUMED: {text}. {ending}" if text else "")


def test_a_drive_whose_motion_is_reversed_but_not_its_force_follows_no_force():
    node = unconnected_node(values={(0x607E, 0): 0xC0})
    node.has_target_force = True
    learn_scaling(node)
    assert node.own.assumed == ["607Eh is C0h: positions and velocities are reversed, target forces are not"]
    node.server.dictionary.values[0x607E, 0] = 0
    learn_scaling(node)
    assert node.own.assumed == []


def test_a_drive_that_is_set_up_for_another_motor():
    assert wrong_motor(unconnected_node()) == ""
    node = unconnected_node(motor="lm1247")
    learn_scaling(node)
    text = wrong_motor(node)
    assert text.startswith("axis: the drive is set up for another motor than ")
    assert text.endswith("or set the drive up for its motor (twin hil set). It is not written.")


@pytest.mark.parametrize("index", [0x6064, 0x606C, 0x607A])
def test_objects_of_process_data_have_to_be_mappable(index):
    node = unconnected_node()
    entry = node.mirror.objects[index][0]
    node.mirror.objects[index][0] = replace(entry, mappable=False)
    assert f"axis: {index:04X}h cannot be mapped to process data." in learn_objects(node).problems
