"""The model of an identification: replayed inputs, members with influence, cached simulations, derivatives, delays."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.study.identified import TIME, output
from tests.study.recordings import MODEL
from twin.coupling import MemberVariable
from twin.errors import SimulationError, TwinError
from twin.identify import model as identify_model
from twin.identify.model import CACHE_SIZE, Model, Simulated, moved, sampled
from twin.identify.recordings import replay
from twin.run import resolve_catalogs
from twin.scenario import ConnectionSpec, MemberSpec, parse_scenario, read


@pytest.mark.parametrize(("count", "values"), [(3, [7.0, 8.0, 9.0, 9.0, 9.0]), (1, [7.0] * 5)])
def test_a_recorded_column_is_replayed_row_by_row_and_its_end_held(count, values):
    table = np.array([7.0, 8.0, 9.0, 10.0])
    member = replay.Replay(table=table.ctypes.data, count=count)
    member.row = 5
    member.initialize()
    found = [float(member.value)]
    for k in range(4):
        member.step(0.1 * k, 0.1)
        found.append(float(member.value))
    assert found == values


@pytest.fixture(scope="module")
def model():
    text = MODEL.replace("  sheath:", "  second: {component: sheath}\n  sheath:").replace(
        "connections: [", "connections: [{from: chirp.position, to: second.gripper_position, factor: 2}, "
    )
    scenario = parse_scenario(text, "model.yaml")
    return scenario.cases()[0], resolve_catalogs(scenario)["base"]


def connected(case):
    return [(one.source, one.target, one.factor) for one in case.connections]


def test_a_recorded_output_drives_all_that_read_it(model):
    case, catalog = model
    driven = replay.with_recorded_inputs(case, catalog, ["chirp.position"])
    assert sorted(connected(driven)) == [
        ("recorded 1.value", "second.gripper_position", 2.0),
        ("recorded 1.value", "sheath.gripper_position", 1.0),
    ]
    assert driven.members["recorded 1"] == MemberSpec("recorded", made=replay.Replay)
    assert list(driven.members) == [*case.members, "recorded 1"]


def test_a_recorded_output_is_converted_as_the_output_was():
    """Its values are in the unit of the output, not in that of who reads it."""
    catalog = {
        "a": {"y": MemberVariable("y", "output", "continuous", "Float64", np.dtype(np.float64), (), "mm")},
        "b": {"u": MemberVariable("u", "input", "continuous", "Float64", np.dtype(np.float64), (), "m")},
    }
    for given, factor, offset in (
        (ConnectionSpec("a.y", "b.u"), 1e-3, 0.0),
        (ConnectionSpec("a.y", "b.u", factor=2.0, offset=3.0), 2e-3, 3.0),
        (ConnectionSpec("a.y", "b.u", factor=2.0, convert=False), 2.0, 0.0),
    ):
        found = replay.redirected(given, "recorded 1.value", catalog)
        assert (found.source, found.target, found.factor, found.offset) == ("recorded 1.value", "b.u", factor, offset)
        assert not found.convert


def test_recorded_inputs_replace_what_drives_them(model):
    case, catalog = model
    driven = replay.with_recorded_inputs(case, catalog, ["sheath.gripper_position", "second.gripper_position"])
    assert connected(driven) == [
        ("recorded 1.value", "sheath.gripper_position", 1.0),
        ("recorded 2.value", "second.gripper_position", 1.0),
    ]
    assert replay.catalog_of(driven, catalog).keys() == driven.members.keys()
    assert "table" in replay.catalog_of(driven, catalog)["recorded 2"]
    assert replay.catalog_of(driven, catalog)["sheath"] is catalog["sheath"]
    with pytest.raises(TwinError, match=r"^sheath\.tip_position: nothing in the model reads it, .* Name an input\.$"):
        replay.with_recorded_inputs(case, catalog, ["sheath.tip_position"])


def test_recorded_members_read_their_tables(model):
    case, catalog = model
    driven = replay.with_recorded_inputs(case, catalog, ["sheath.gripper_position", "second.gripper_position"])
    own = replay.with_influence(driven, ["second.tip_position", "second.position[2]"])
    assert list(own.members) == ["second", "recorded 2"]
    tables = [np.zeros(3), np.zeros(5)]
    bound = replay.bind_tables(own, tables)
    assert bound.members["recorded 2"].parameters == {"table": tables[1].ctypes.data, "count": 5}
    assert bound.members["second"] == own.members["second"]
    assert own.record.patterns == ("second.tip_position", "second.position")


@dataclass(frozen=True)
class Condition:
    sources: frozenset
    targets: frozenset
    actions: tuple


@dataclass(frozen=True)
class System:
    members: dict
    connections: tuple
    events: tuple
    conditions: tuple
    faults: tuple = ("a fault",)
    record: object = None


def test_members_without_influence_are_left_out():
    """a -> b -> c is compared; d acts on b by a condition; e and f only listen, and what happens to them alone does not count."""
    connections = tuple(ConnectionSpec(f"{s}.y", f"{t}.u") for s, t in ("ab", "bc", "ce", "df"))
    events = tuple(SimpleNamespace(variable=f"{name}.u") for name in "ae")
    acting = Condition(frozenset("d"), frozenset("be"), tuple(SimpleNamespace(variable=f"{name}.u") for name in "be"))
    listening = Condition(frozenset("f"), frozenset("e"), (SimpleNamespace(variable="e.u"),))
    case = System(dict.fromkeys("abcdef"), connections, events, (acting, listening))
    own = replay.with_influence(case, ["c.y[2]", "c.y[3]", "c.z"])
    assert list(own.members) == ["a", "b", "c", "d"]
    assert [one.target for one in own.connections] == ["b.u", "c.u"]
    assert [one.variable for one in own.events] == ["a.u"]
    (condition,) = own.conditions
    assert [one.variable for one in condition.actions] == ["b.u"]
    assert own.faults == ()
    assert own.record.patterns == ("c.y", "c.z")


def test_a_path_in_a_file(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("members: {sheath: {parameters: {play: 1}}}\n")
    root = read(path, str(path))
    assert replay.reaches(root, ("members", "sheath", "parameters"))
    assert replay.reaches(root, ())
    assert not replay.reaches(root, ("members", "sheath", "other"))
    assert not replay.reaches(root, ("member", "sheath"))


@every_case(
    ("fields", "expected"),
    [
        ({}, [0.0, 1.0, 2.0, 3.0, 4.0]),
        ({"delay": 0.25}, [0.0, 0.5, 1.5, 2.5, 3.5]),
        ({"delay": -0.5}, [1.0, 2.0, 3.0, 4.0, 4.0]),
        ({"delay": "lag"}, [0.0, 0.0, 1.0, 2.0, 3.0]),
        ({"offset": 10.0}, [10.0, 11.0, 12.0, 13.0, 14.0]),
        ({"offset": "zero", "delay": "lag"}, [-2.0, -2.0, -1.0, 0.0, 1.0]),
        ({"element": 1}, [0.0, 10.0, 20.0, 30.0, 40.0]),
    ],
)
def test_a_signal_is_compared_at_the_times_of_measurement(fields, expected):
    """Recorded at 0, 0.5, ... s it grows by 1 each; its second element ten times as fast."""
    of = output()
    for key, value in fields.items():
        object.__setattr__(of, key, value)
    values = {"lag": 0.5, "zero": -2.0}
    steps = np.arange(5.0)
    whole = {"sheath.tip": np.stack([steps, 10 * steps], 1)}
    assert sampled(of, TIME, whole, values) == pytest.approx(expected)
    if not of.element:
        assert sampled(of, TIME, {"sheath.tip": steps}, values) == pytest.approx(expected)
    if not isinstance(of.offset, str) and not of.offset and not of.element:
        assert moved(of, TIME, steps, values) == pytest.approx(expected)
    object.__setattr__(of, "signal", "sheath.tip[2]")
    assert sampled(of, TIME, whole, values) == pytest.approx(expected)


def simulated(references, **fields):
    """A simulated recording without members."""
    own = object.__new__(Simulated)
    own.count, own.refused, own._cache, own._references = 0, "", {}, references
    for name, value in fields.items():
        setattr(own, name, value)
    return own


def test_simulations_are_kept_by_the_values_that_they_depend_on():
    calls = []
    own = simulated({"a": None, "b": None}, _simulated=lambda values: calls.append(values["a"]) or (values["a"], {}))
    for k in range(CACHE_SIZE):
        own.signals({"a": k, "b": 0, "other": k})
    assert own.signals({"a": 0, "b": 0, "other": 99}) == (0, {})  # now the last one
    assert calls == list(range(CACHE_SIZE))
    own.signals({"a": -1, "b": 0})
    own.signals({"a": 0, "b": 0})
    assert len(calls) == CACHE_SIZE + 1
    own.signals({"a": 1, "b": 0})  # the one that was used the longest time ago
    assert len(calls) == CACHE_SIZE + 2
    own.signals({"a": 0, "b": 1})
    assert len(calls) == CACHE_SIZE + 3
    assert len(own._cache) == CACHE_SIZE


def reference(name, first=0, size=1):
    return SimpleNamespace(variable=SimpleNamespace(name=name), first=first, size=size)


@pytest.fixture
def derived(monkeypatch):
    """A recording of outputs tip and force of a member; parameter p of two elements and q of one.

    A recorder with slopes of shape (times, outputs, parameter elements); what is asked of it, and calls.
    """
    tip, force = output(), output()
    object.__setattr__(tip, "delay", 0.5)
    object.__setattr__(force, "signal", "motor.force[3]")
    object.__setattr__(force, "element", 2)
    found = {"sheath.tip": reference("tip"), "motor.force[3]": reference("force", 1)}
    monkeypatch.setattr(identify_model, "find", lambda name, _catalog: found[name])
    slopes = np.arange(30.0).reshape(5, 2, 3)
    recorder = SimpleNamespace(slopes=slopes, times=list(TIME), failure="")
    asked = {}
    running = SimpleNamespace(members="members", links="links", failure="", terminate=lambda: asked.update(ended=True))
    monkeypatch.setattr(identify_model, "watched", lambda *arguments: asked.update(asked=arguments) or recorder)
    monkeypatch.setattr(identify_model, "run_case", lambda *arguments: asked.update(ran=arguments[:2]))
    case = SimpleNamespace(actions=())
    own = simulated(
        {"sheath.p": ("sheath", reference("p", 4, 2)), "motor.q": ("motor", reference("q"))},
        _saved={},
        _made=lambda values: asked.update(made=values) or running,
        recording=SimpleNamespace(outputs=(tip, force), catalog={}, case=case),
    )
    return SimpleNamespace(own=own, recorder=recorder, running=running, asked=asked, slopes=slopes, case=case)


def test_derivatives_are_those_of_all_elements_of_a_parameter(derived):
    own, slopes = derived.own, derived.slopes
    found = own.slopes({"sheath.p": 1.0, "motor.q": 2.0})
    assert derived.asked == {
        "made": {"sheath.p": 1.0, "motor.q": 2.0},
        "asked": (
            "members",
            "links",
            [("sheath", "p", 4), ("sheath", "p", 5), ("motor", "q", 0)],
            [("sheath", "tip", 0), ("motor", "force", 3)],
        ),
        "ran": (derived.case, derived.running),
        "ended": True,
    }
    both = slopes[:, :, 0] + slopes[:, :, 1]
    late = [0, 0, 1, 2, 3]  # by the delay of half a second
    assert found["sheath.p"][0] == pytest.approx(both[late, 0])
    assert found["sheath.p"][1] == pytest.approx(both[:, 1])
    assert found["motor.q"][0] == pytest.approx(slopes[late, 0, 2])
    assert found["motor.q"][1] == pytest.approx(slopes[:, 1, 2])
    assert list(found) == ["sheath.p", "motor.q"]
    assert (own.count, own.refused) == (1, "")


def test_where_there_are_no_derivatives(derived, monkeypatch):
    own, values = derived.own, {"sheath.p": 1.0, "motor.q": 2.0}
    derived.recorder.failure = "a member tells none"
    assert own.slopes(values) is None
    assert own.refused == "a member tells none"
    derived.running.failure = "it ended"
    assert own.slopes(values) is None
    assert own.refused == "it ended"
    assert own.count == 2
    own.refused, derived.recorder.failure, derived.running.failure = "", "", ""
    derived.case.actions = ("an event",)
    assert own.slopes(values) is None
    derived.case.actions = ()
    monkeypatch.setattr(identify_model, "watched", lambda *_: None)
    assert own.slopes(values) is None
    assert (own.count, own.refused) == (2, "")
    own._saved = {"sheath": 1}
    derived.asked.clear()
    assert own.slopes(values) is None
    assert derived.asked == {}


class Recorded:
    """Stands in for a simulated recording."""

    def __init__(self, recording, unknowns, _build):
        if recording == "broken":
            raise SimulationError("it fails")
        self.recording, self.unknowns, self.count, self.refused, self.told, self.closed = (
            recording,
            unknowns,
            3,
            "",
            None,
            False,
        )

    def signals(self, values):
        return TIME, {"sheath.tip": values["p"] * np.arange(5.0)}

    def slopes(self, _values):
        return self.told

    def close(self):
        self.closed = True


@pytest.fixture
def two(monkeypatch, tmp_path):
    """A model of two recordings with one and two outputs; unknowns p of a member and a delay."""
    made = []
    monkeypatch.setattr(identify_model, "Simulated", lambda *options: made.append(Recorded(*options)) or made[-1])
    recordings = [SimpleNamespace(outputs=(output(),) * count) for count in (1, 2)]
    problem = SimpleNamespace(
        recordings=recordings,
        of=lambda recording: len(recording.outputs),
        values=lambda positions: {"p": float(positions[0])},
        unknowns=[
            SimpleNamespace(name="p", member="sheath"),
            SimpleNamespace(name="delay", member=""),
            SimpleNamespace(name="q", member="m"),
        ],
    )
    return Model(problem, tmp_path), made


def test_a_model_predicts_all_recordings(two):
    model, made = two
    assert [one.unknowns for one in made] == [1, 2]
    assert model.count == 6
    predicted = model.predicted(np.array([2.0]))
    assert [one.tolist() for one in predicted] == [[0, 2, 4, 6, 8]] * 3
    with pytest.raises(SimulationError, match=r"^what is compared is not finite$"):
        model.predicted(np.array([np.nan]))
    with model:
        assert not made[0].closed
    assert [one.closed for one in made] == [True, True]


def test_derivatives_of_all_recordings_by_the_parameters_of_members(two):
    model, made = two
    first, second, third = (np.full(5, x) for x in (1.0, 2.0, 3.0))
    made[0].told, made[1].told = {"p": [first]}, {"p": [second, third], "q": [first, first]}
    found = model.slopes(np.array([2.0]))
    assert {number: [one.tolist() for one in columns] for number, columns in found.items()} == {
        0: [[1] * 5, [2] * 5, [3] * 5],
        2: [[0] * 5, [1] * 5, [1] * 5],
    }
    assert model.derivatives == "differences"
    model.used = True
    assert model.derivatives == "directional derivatives"
    made[1].told, made[1].refused = None, "b is odd"
    assert model.slopes(np.array([2.0])) is None
    assert model.derivatives == "differences, since b is odd"
    made[0].told = None
    assert model.slopes(np.array([2.0])) is None
    assert model.refused == "b is odd"


def test_a_model_that_cannot_be_made_frees_what_was(two, tmp_path):
    _, made = two
    problem = SimpleNamespace(recordings=["whole", "broken"], of=lambda _: ())
    with pytest.raises(SimulationError, match="it fails"):
        Model(problem, tmp_path)
    assert made[-1].recording == "whole"
    assert made[-1].closed
