"""Touch probes of CiA 402: which edge of which input stores which position, once or each time."""

from hw_bridge.device.touch_probe import TouchProbes
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import axis

LOW, HIGH = 2e-3, 4e-3  # the input is closed between these [m]
POSITIONS = (0x60BA, 0x60BB, 0x60BC, 0x60BD)


def probed(function, ways, probes=((LOW, HIGH), (LOW, HIGH)), origin=0.0):
    """Status word and stored positions [um] after each position [mm] on a way that begins at 0."""
    turned = axis()
    turned.origin = origin
    turned.switches.probes = probes
    touch, dictionary = TouchProbes(turned), turned.dictionary
    dictionary.put(0x60B8, function)
    found = []
    for place in ways:
        turned.motor.measured_position = 1e-3 * place
        touch.cycle()
        found.append((dictionary.get(0x60B9), *(dictionary.get(index) for index in POSITIONS)))
    return found


@every_case(
    ("function", "way", "last"),
    [
        (0x00, (3, 5), (0x00, 0, 0, 0, 0)),
        (0x01, (3, 5), (0x01, 0, 0, 0, 0)),  # enabled, no edge chosen
        (0x11, (1,), (0x01, 0, 0, 0, 0)),
        (0x11, (2,), (0x03, 2000, 0, 0, 0)),  # exactly at the edge it is closed
        (0x11, (3, 5), (0x03, 2000, 0, 0, 0)),
        (0x21, (3, 5), (0x05, 0, 4000, 0, 0)),
        (0x31, (3, 5), (0x07, 2000, 4000, 0, 0)),
        (0x31, (5, 3, 1), (0x07, 4000, 2000, 0, 0)),  # from above
        (0x31, (5,), (0x01, 0, 0, 0, 0)),  # both edges in one control cycle: not seen
        (0x1100, (3, 5), (0x0300, 0, 0, 2000, 0)),
        (0x2100, (3, 5), (0x0500, 0, 0, 0, 4000)),
        (0x3131, (3, 5), (0x0707, 2000, 4000, 2000, 4000)),
        # once: the first edge counts; continuous: each
        (0x31, (3, 5, 3, 1), (0x07, 2000, 4000, 0, 0)),
        (0x33, (3, 5, 3, 1), (0x07, 4000, 2000, 0, 0)),
        # the index pulse, each 24 mm, is both edges
        (0x35, (23,), (0x01, 0, 0, 0, 0)),
        (0x35, (23, 24), (0x07, 24000, 24000, 0, 0)),
        (0x15, (30, 20), (0x03, 24000, 0, 0, 0)),
        (0x37, (30, 20, -1), (0x07, 0, 0, 0, 0)),
        (0x15, (-1, -30), (0x03, 0, 0, 0, 0)),
        (0x17, (-1, -30), (0x03, -24000, 0, 0, 0)),
        (0x19, (3, 30), (0x01, 0, 0, 0, 0)),  # a source that there is not
    ],
)
def test_stored_positions(function, way, last):
    assert probed(function, way)[-1] == last


def test_probes_have_inputs_of_their_own():
    assert probed(0x1111, (3, 7), probes=((LOW, HIGH), (6e-3, 8e-3)))[-1] == (0x0303, 2000, 0, 6000, 0)
    assert probed(0x1111, (3, 7), probes=(None, (6e-3, 8e-3)))[-1] == (0x0301, 0, 0, 6000, 0)


def test_positions_count_from_the_origin_and_stay_in_their_type():
    assert probed(0x11, (3,), origin=0.5e-3)[-1] == (0x03, 1500, 0, 0, 0)
    assert probed(0x11, (3,), origin=1e9)[-1][1] == -(2**31)


def test_switching_off_forgets_the_status_and_begins_anew():
    turned = axis()
    turned.switches.probes = ((LOW, HIGH), None)
    touch, dictionary = TouchProbes(turned), turned.dictionary
    shown = []
    for function, place in ((0x31, 3), (0x00, 3), (0x00, 1), (0x31, 1), (0x31, 2.5), (0x30, 2.5), (0x31, 2.5)):
        dictionary.put(0x60B8, function)
        turned.motor.measured_position = 1e-3 * place
        touch.cycle()
        shown.append((dictionary.get(0x60B9), dictionary.get(0x60BA)))
    assert shown == [(0x03, 2000), (0, 2000), (0, 2000), (0x01, 2000), (0x03, 2000), (0, 2000), (0x01, 2000)]


def test_an_edge_while_it_is_off_is_not_stored_later():
    assert [row[0] for row in probed(0x00, (3, 5))] == [0, 0]
    turned = axis()
    turned.switches.probes = ((LOW, HIGH), None)
    touch = TouchProbes(turned)
    turned.motor.measured_position = 3e-3
    touch.cycle()
    turned.dictionary.put(0x60B8, 0x11)
    touch.cycle()
    assert turned.dictionary.get(0x60B9) == 0x01
    turned.dictionary.put(0x60B8, 0x21)
    turned.motor.measured_position = 5e-3
    touch.start()
    touch.cycle()
    assert (turned.dictionary.get(0x60B9), turned.dictionary.get(0x60BB)) == (0x01, 0)
