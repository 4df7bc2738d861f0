"""Tables of variable steps: what each element of a connection is fed, in which parts steps are made, options in the record."""

import ctypes
from types import SimpleNamespace

import numpy as np

from tests.coupling.test_plan import GET, MS, SET, Fake, records, variable
from tests.every_case import every_case
from twin.coupling import Algorithm, Connection, CoupledSystem, StateAccess
from twin.coupling.execution import loop
from twin.coupling.execution.loop import KINDS
from twin.coupling.execution.loop_tables import Tables
from twin.coupling.execution.value_memory import bits
from twin.coupling.variable_step.input_extrapolation import CATEGORY, USE
from twin.coupling.variable_step.record_layout import (
    ANDERSON,
    ARRIVED,
    DEPTH,
    DOUBLING,
    EXTRAPOLATED,
    FEED,
    FINAL,
    FIRST,
    GUESSED,
    HELD,
    MEAN,
    NEWTON,
    PART,
    PREDICTED,
    RELAXED,
    RESIDUAL,
    SCALE,
    SHARE,
    SLOPE,
    STAGE,
    TO_ARRIVED,
    TO_GUESS,
    VALUE,
)
from twin.coupling.variable_step.stage_tables import Stages
from twin.coupling.variable_step.state import VariableStepState


class Part(Fake):
    """A member with state access by memory if it is a record, else by calls; `slopes`: takes derivatives of inputs."""

    def __init__(self, number, *variables, base=0, slopes=0, period=0):
        super().__init__(number, *variables, base=base)
        self.slopes_address, self.period_ns = slopes, period

    def input_derivatives(self):
        return self.slopes_address

    def state_access(self, count):
        if self.base:
            return StateAccess(self.base, 20)
        pointers = 50 + 10 * self.instance, 51 + 10 * self.instance
        return StateAccess(get=GET, set=SET, pointer_addresses=pointers[:count])


def pair(**options):
    """Two records: "a" at 400, whose output depends on its input, and "b" at 800, whose output does not."""
    a = Part(0, variable("y", "output"), variable("u", "input", shape=(2,)), base=400)
    b = Part(1, variable("y", "output", shape=(2,), dependencies=()), variable("u", "input", "f4"), base=800, **options)
    return {"a": a, "b": b}


WIRES = ["a.y -> b.u", "b.y -> a.u"]


def staged(
    algorithm, members=None, wires=WIRES, order=(("a",), ("b",)), recorded=(), periods=None, events=None, **fields
):
    members = members or pair()
    catalog = {name: member.variables for name, member in members.items()}
    connections = [Connection(*wire.split(" -> ")) if isinstance(wire, str) else wire for wire in wires]
    periods = {name: (periods or {}).get(name, 4 * MS) for name in members}
    plan = Stages(members, 4 * MS, periods, algorithm=Algorithm(algorithm), **fields)
    plan.links = CoupledSystem(catalog, connections).links()
    plan.events = events and SimpleNamespace(links=plan.links, address=99, index=0)
    plan.build([list(stage) for stage in order], plan.links, list(recorded))
    return plan


@every_case(
    ("algorithm", "order", "hold", "expected"),
    [  # what "b", then what both values of "a" are fed; "a" steps first
        ({"name": "jacobi", "order": 1}, [["a", "b"]], False, [EXTRAPOLATED, EXTRAPOLATED, EXTRAPOLATED]),
        ({"name": "jacobi", "order": 1}, [["a", "b"]], True, [HELD, HELD, HELD]),
        ({"name": "gauss_seidel", "order": 1}, [["a"], ["b"]], False, [TO_ARRIVED, EXTRAPOLATED, EXTRAPOLATED]),
        ({"name": "gauss_seidel", "order": 1}, [["b"], ["a"]], False, [EXTRAPOLATED, TO_ARRIVED, TO_ARRIVED]),
        ({"name": "gauss_seidel", "order": 1}, [["a"], ["b"]], True, [ARRIVED, HELD, HELD]),
        ("iterative", [["a"], ["b"]], False, [ARRIVED, GUESSED, GUESSED]),
        ({"name": "iterative", "order": 1}, [["a"], ["b"]], False, [TO_ARRIVED, TO_GUESS, TO_GUESS]),
        ({"name": "iterative", "order": 1}, [["a"], ["b"]], True, [ARRIVED, GUESSED, GUESSED]),
        ("predictive", [["a", "b"]], False, [HELD, HELD, HELD]),
    ],
)
def test_what_an_input_is_fed_follows_from_the_order_of_the_members(algorithm, order, hold, expected):
    wires = [Connection(*wire.split(" -> "), hold=hold) for wire in WIRES]
    plan = staged(algorithm, wires=wires, order=order)
    elements = plan.all_elements
    assert [element.source for element in elements] == expected
    assert [element.number for element in elements] == [0, 1, 2]
    feedback = [expected[i] not in (ARRIVED, TO_ARRIVED) for i in range(3)]
    assert [element.is_torn for element in elements] == feedback
    assert all(element.is_moving for element in elements)
    assert [element.is_judged(predicted=True) for element in elements] == [torn and not hold for torn in feedback]
    assert [element.is_judged(predicted=False) for element in elements] == [not hold] * 3


def test_each_element_has_its_place_in_both_memories():
    """Members with feedthrough make two parts of a step, others one."""
    plan = staged({"name": "gauss_seidel", "order": 1})
    n = 3
    assert plan.course - plan.vectors >= 8 * 5 * n
    assert plan.past == plan.course + 8 * 4 * n
    first, second = plan.stages
    whole, last = 1.0 - SHARE, plan.staged["a", "u"]
    addresses = [[plan.vectors + 8 * i, plan.course + 8 * i] for i in range(n)]

    def feeds(use, numbers, source, target, step, category, code):
        weights = plan.weights + category + use * USE
        return [[*addresses[i], source, weights, target + step * j, KINDS[code]] for j, i in enumerate(numbers)]

    assert first["parts"] == [
        (feeds(FIRST, (1, 2), EXTRAPOLATED, last, 8, 0, "f8"), {"accesses": (0, 0), "steps": (0, 1)}, 0.0, whole),
        (feeds(FINAL, (1, 2), EXTRAPOLATED, last, 8, 0, "f8"), {"accesses": (0, 0), "steps": (0, 1)}, whole, SHARE),
    ]
    assert len(second["parts"]) == 1, "its output does not depend on its input"
    ((rows, operation, begin, length),) = second["parts"]
    assert rows == feeds(MEAN, (0,), TO_ARRIVED, plan.staged["b", "u"], 4, CATEGORY, "f4")
    assert (operation, begin, length) == ({"accesses": (0, 0), "steps": (1, 2)}, 0.0, 1.0)
    # connections arrive as Float64 in the elements; those of feedback are read again at the end of a sweep
    one = [1, bits(1.0), bits(0.0)]
    assert plan.copies == [[800, plan.vectors + 8, 2], [800, plan.vectors + 8, 2]]
    assert plan.converts == [[400, KINDS["f8"], plan.vectors, KINDS["f8"], *one]]
    assert [stage["links"] for stage in plan.stages] == [
        {"copies": (0, 1), "converts": (0, 0)},
        {"copies": (1, 1), "converts": (0, 1)},
    ]
    assert plan.feedback == {"copies": (1, 2), "converts": (1, 1)}
    assert plan.operations == plan.begins == plan.ends == []


def test_whole_numbers_are_moved_directly_and_calls_set_what_is_fed():
    members = {
        "a": records()["a"],
        "f": Part(2, variable("y", "output", dependencies=()), variable("u", "input"), variable("k", "input", "b1")),
    }
    members["a"].input_derivatives, members["a"].period_ns = (lambda: 0), 0
    plan = staged(
        {"name": "jacobi", "order": 2},
        members,
        ["a.y[3] -> f.u", "a.b -> f.k", "f.y -> a.u[2]"],
        [["a", "f"]],
        recorded=[("a", "y")],
    )
    (stage,) = plan.stages
    assert [element.source for element in plan.all_elements] == [EXTRAPOLATED] * 2
    k = plan.staged["f", "k"]
    assert plan.converts[0] == [432, KINDS["b1"], k, KINDS["b1"], 1, bits(1.0), bits(0.0)]
    assert stage["direct"] == {"copies": (2, 2), "converts": (0, 1)}
    assert [row[0] for row in plan.accesses] == [SET + 12, SET + 12, GET + 12]
    assert stage["gets"]["accesses"] == (2, 3)
    by_uses = {(begin, length): (len(rows), operation) for rows, operation, begin, length in stage["parts"]}
    assert by_uses[0.0, 1.0] == (1, {"accesses": (0, 2), "steps": (1, 2)}), "f: its output does not depend on its input"
    assert by_uses[0.0, 1.0 - SHARE] == (1, {"accesses": (0, 0), "steps": (0, 1)})
    assert plan.records == [[400, 8, 3]]


def test_a_member_that_takes_derivatives_gets_value_slope_and_curvature():
    members = pair() | {"f": Part(2, variable("y", "output"), variable("u", "input", reference=9), slopes=70)}
    plan = staged({"name": "jacobi", "order": 2}, members, ["a.y -> f.u"], [["a", "b", "f"]])
    (element,) = plan.all_elements
    ((rows, operation, begin, length),) = (part for part in plan.stages[0]["parts"] if len(part[0]) == 3)
    assert (begin, length) == (0.0, 1.0)
    setter, call = plan.accesses[slice(*operation["accesses"])]
    assert setter[0] == SET + 12
    assert [call[0], call[1], call[3], call[6]] == [70, 12, 2, 2]
    references = np.ctypeslib.as_array((ctypes.c_uint32 * 2).from_address(call[2])).tolist()
    orders = np.ctypeslib.as_array((ctypes.c_int32 * 2).from_address(call[4])).tolist()
    assert (references, orders) == ([9, 9], [1, 2])
    weights = [plan.weights + use * USE for use in (VALUE, SLOPE, SLOPE + 1)]
    assert [row[3] for row in rows] == weights
    assert [row[4] for row in rows] == [plan.staged["f", "u"], call[5], call[5] + 8]
    assert [row[2] for row in rows] == [element.source] * 3
    assert plan.functions[70] == "fmi2SetRealInputDerivatives"


def test_members_with_a_period_step_at_the_begin_of_a_tick_and_publish_at_its_end():
    plan = staged("iterative", periods={"b": 12 * MS})
    assert plan.slow == {"b"}
    (stage,) = plan.stages
    assert len(stage["parts"]) == 1
    (begin,), (publish,) = plan.begins, plan.ends
    assert (begin["divider"], begin["h"], begin["steps"]) == (3, bits(0.012), (1, 2))
    assert (publish["divider"], publish["shift"]) == (3, 1)
    assert [element.is_moving for element in plan.all_elements] == [False, False]
    assert [element.source for element in plan.all_elements] == [HELD, HELD]
    assert not any(element.is_torn or element.is_judged(predicted=False) for element in plan.all_elements)
    assert [one.get("divider") for one in plan.stepping_operations()] == [3, None]
    sampled = staged("iterative", pair(period=4 * MS))
    assert sampled.slow == {"b"}
    assert [plan.is_read_directly(name) for name in "ab"] == [True, False]


def state_of(plan, corrected=()):
    state = np.zeros(1, loop.RECORD)[0]
    tables = Tables(plan, plan.members)
    made = VariableStepState(plan, tables, state, plan.step_ns, list(corrected))
    made.tables = tables
    return made


OPTIONS = {  # for a step of 4 ms: what is not 0
    "predictive": {
        "control": PREDICTED,
        "scheme": ANDERSON,
        "trial": 1,
        "recalls": 1,
        "divisions": 2048,
        "stride": 2048,
    },
    "step_doubling": {
        "control": DOUBLING,
        "scheme": ANDERSON,
        "trial": 1,
        "divisions": 2048,
        "stride": 2048,
        "least": 2,
    },
    "iterative": {"scheme": ANDERSON, "trial": 1, "recalls": 1, "max_iterations": 20},
    "ecco": {"control": RESIDUAL, "order": 1, "recalls": 1, "divisions": 2048, "stride": 2048},
    "energy": {"order": 1, "recalls": 1},
}
GIVEN = [
    ("jacobi", {"order": 2, "smoothing": 0.5}, {"order": 2, "recalls": 1}),
    ("iterative", {"acceleration": "newton", "unsolved": "stop"}, {"scheme": NEWTON, "derives": 1, "strict": 1}),
    ("iterative", {"acceleration": "relaxed", "iterations": 3}, {"scheme": RELAXED, "max_iterations": 3}),
    ("step_doubling", {"smallest": 2 * MS}, {"divisions": 2, "stride": 2, "least": 2}),
    (
        "step_doubling",
        {"iterations": 4, "acceleration": "newton"},
        {"max_iterations": 4, "derives": 1, "scheme": NEWTON, "recalls": 1},
    ),
    ("predictive", {"smallest": 4 * MS}, {"divisions": 1, "stride": 1}),
    ("ecco", {"correction": 0.25, "order": 0}, {"order": 0}),
    *((name, {}, {}) for name in OPTIONS),
]


@every_case(("name", "options", "changes"), GIVEN)
def test_the_record_has_the_options_of_the_algorithm(name, options, changes):
    algorithm = Algorithm(name, **options)
    plan = staged({"name": name, **options}, order=[["a"], ["b"]] if algorithm.is_sequential else [["a", "b"]])
    state = state_of(plan).state
    zero = "order max_iterations scheme control trial strict recalls derives"
    expected = dict.fromkeys(zero.split(), 0) | {"divisions": 1, "stride": 1, "least": 1}
    expected |= OPTIONS.get(name, {}) | changes
    assert {key: int(state[key]) for key in expected} == expected
    assert float(state["relaxation"]) == 1.0
    assert float(state["tick_length"]) == 0.004
    assert float(state["next_step"]) == (0.004 if name == "ecco" else 0.0), "without bonds steps are whole ones"
    assert float(state["smoothing"]) == options.get("smoothing", 0.0)
    assert float(state["correction"]) == options.get("correction", 1.0 if name == "energy" else 0.0)
    names = {"coupling_tolerance": "agreement", "tolerance": "tolerance", "floor": "floor"}
    assert {key: float(state[key]) for key in names} == {key: getattr(algorithm, own) for key, own in names.items()}


def words(address, count):
    return np.ctypeslib.as_array((ctypes.c_int64 * count).from_address(int(address))).tolist()


def test_the_record_has_the_addresses_of_all_tables():
    """Element 0 arrives at "b"; the two of "a" are torn, and judged."""
    plan = staged({"name": "predictive", "order": 1, "sequential": True, "scales": {"a.u": 3.0}})
    made = state_of(plan)
    state, arrays = made.state, made.tables.arrays
    assert {name: int(state[f"{name}_count"]) for name in ("torn", "moving", "judged", "bond", "stage", "region")} == {
        "torn": 2,
        "moving": 3,
        "judged": 2,
        "bond": 0,
        "stage": 2,
        "region": 4,  # the plan's memory, the polynomials', and two records
    }
    assert words(state["torn"], 2) == words(state["judged"], 2) == [1, 2]
    assert words(state["moving"], 3) == [0, 1, 2]
    fields = ("elements", "vectors", "course", "past", "weights")
    assert [int(state[name]) for name in fields] == [3, plan.vectors, plan.course, plan.past, plan.weights]
    sizes = np.ctypeslib.as_array((ctypes.c_double * 15).from_address(plan.vectors)).reshape(5, 3)[SCALE]
    assert sizes.tolist() == [0.0, 3.0, 3.0], "known sizes"
    operations = made.operations
    base = int(operations.ctypes.data)
    assert len(operations) == 2 * 3 + 3 + 1  # moves of two stages, parts, feedback
    assert int(state["feedback"]) == base + 88 * 9
    assert words(state["feedback"] + 24, 2) == [arrays["copies"].ctypes.data + 24, 1]
    first, second = np.reshape(words(state["stages"], 2 * len(STAGE)), (2, len(STAGE))).tolist()
    assert (first[0], first[1], first[2], first[4]) == (base, 0, 0, 2)
    assert (second[0], second[1], second[2], second[4]) == (base + 88 * 3, 0, 0, 1)
    parts = np.reshape(words(first[3], 2 * len(PART)), (2, len(PART))).tolist()
    assert [part[1:] for part in parts] == [
        [2, base + 88 * 6, bits(0.0), bits(1.0 - SHARE)],
        [2, base + 88 * 7, bits(1.0 - SHARE), bits(SHARE)],
    ]
    assert words(parts[0][0], len(FEED)) == plan.stages[0]["parts"][0][0][0]
    assert words(second[3] + 16, 1) == [base + 88 * 8]
    regions = np.reshape(words(state["regions"], 16), (4, 4)).tolist()
    matrices = max(DEPTH * 2 * 2 + DEPTH * DEPTH + 2 * DEPTH, 2 * 2 + 2)  # of Anderson's method, of Newton's
    assert regions[0][2] - int(state["solver"]) == 8 * (3 * 2 + matrices)
    assert regions[1][:2] == [plan.course, 4 * 3 + 3]
    assert [row[:2] for row in regions[2:]] == [[400, 20], [800, 20]]
    assert all(row[2] == row[3] for row in regions), "one slot"


def test_a_second_slot_and_states_by_calls():
    members = {"a": pair()["a"], "f": Part(2, variable("y", "output", shape=(2,)), variable("u", "input"))}
    plan = staged({"name": "step_doubling", "iterations": 5}, members, ["a.y -> f.u", "f.y -> a.u"], [["a"], ["f"]])
    state = state_of(plan).state
    assert int(state["state_count"]) == 1
    assert words(state["states"], 6) == [GET, SET, 12, 50 + 120, 51 + 120, 1]
    regions = np.reshape(words(state["regions"], 12), (3, 4)).tolist()
    assert all(row[3] - row[2] >= 8 * row[1] or row[2] - row[3] >= 8 * row[1] for row in regions)
    plain = staged("predictive", members, ["a.y -> f.u"], [["a"], ["f"]])
    assert words(state_of(plain).state["states"], 6) == [GET, SET, 12, 170, 170, 1]


def test_inputs_that_do_not_agree_are_sorted_by_how_much():
    plan = staged({"name": "iterative", "agreement": 0.1, "floor": 2.0})
    made = state_of(plan)
    vectors = np.ctypeslib.as_array((ctypes.c_double * 15).from_address(plan.vectors)).reshape(5, 3)
    assert made.disagreements() == []
    vectors[0] = 5.0, 1.0, 4.0  # now; the guesses are 0, the sizes 2, 2 and 4
    assert made.disagreements() == ["a.u"]
    vectors[0] = 5.0, 0.2, 0.2
    assert made.disagreements() == [], "exactly as much as tolerated; element 0 is no guess"
    vectors[0] = 0.0, 0.201, 0.0
    assert made.disagreements() == ["a.u"]
    vectors[0] = 0.0, np.nan, 0.0
    assert made.disagreements() == ["a.u"]
    past = np.ctypeslib.as_array((ctypes.c_double * 3).from_address(plan.past))
    past[:] = 1.0
    made.forget()
    assert past.tolist() == [0.0] * 3


def test_newtons_matrix_is_the_unit_matrix_minus_the_jacobian(monkeypatch):
    plan = staged({"name": "iterative", "acceleration": "newton"})
    made = state_of(plan)
    jacobian = np.array([[0.5, -0.25], [0.125, -1.0]])
    asked = []
    given = [jacobian, np.eye(2), None]
    coupling = SimpleNamespace(jacobian=lambda t, h: asked.append((t, h)) or given.pop(0))
    monkeypatch.setattr("twin.coupling.variable_step.state.Coupling", lambda _plan: coupling)
    made.state["step_begin"], made.state["span"] = 0.25, 0.004
    made.derive()
    assert asked == [(0.25, 0.004)]
    assert (int(made.state["jacobian"]), float(made.state["linear_at"]), int(made.state["derives"])) == (1, 0.004, 1)
    factors = np.ctypeslib.as_array((ctypes.c_double * 4).from_address(int(made.state["solver"]) + 3 * 8 * 2))
    lower, upper = np.eye(2), np.triu(factors.reshape(2, 2))
    lower[1, 0] = factors[2]
    np.testing.assert_allclose(lower @ upper, np.eye(2) - jacobian)
    for _ in range(2):  # a singular matrix, then none: differences are used from then on
        made.state["derives"], made.state["jacobian"] = 1, 0
        made.derive()
        assert (int(made.state["jacobian"]), int(made.state["derives"])) == (0, 0)


def test_at_an_event_values_are_copied_and_not_extrapolated():
    """Rows of their own, beside those that move values to the elements."""
    plan = staged({"name": "jacobi", "order": 1}, order=[["a", "b"]], events=True)
    ((table, row),) = plan.rows_at_events(("a", "u"))
    assert (table, plan.copies[row]) == ("copies", [800, plan.staged["a", "u"], 2])
    ((table, row),) = plan.rows_at_events(("b", "u"))
    one = [1, bits(1.0), bits(0.0)]
    assert (table, plan.converts[row]) == ("converts", [400, KINDS["f8"], plan.staged["b", "u"], KINDS["f4"], *one])
    members = {"a": records()["a"], "f": Part(2, variable("k", "input", "b1"))}
    members["a"].input_derivatives, members["a"].period_ns = (lambda: 0), 0
    whole = staged("iterative", members, ["a.b -> f.k"], [["a"], ["f"]], events=True)
    assert whole.rows_at_events(("f", "k")) == [("converts", 0)], "that of the step"


def test_elements_that_may_be_replaced_are_published_one_by_one_in_their_stage():
    plan = staged("iterative", split=frozenset({("b", "y")}))
    y = plan.published["b", "y"]
    begin, end = plan.stages[1]["gets"]["copies"]
    assert plan.copies[begin:end] == [[800, y, 1], [808, y + 8, 1]]
    assert plan.elements == {("b", "y"): [("copies", begin), ("copies", begin + 1)]}
