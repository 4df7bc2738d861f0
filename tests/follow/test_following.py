"""Following from Python, and the signals of a rig, without a model: revised estimates, units, idle steps."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.errors import SimulationError
from twin.follow import live as live_module
from twin.follow import live_problem
from twin.follow.live import Following
from twin.follow.live_problem import LiveProblem, LiveSignal, has_rig, idle_ticks

MS = 1_000_000


def make(monkeypatch, parts, *, live):
    """Following of a file with these estimates; what is loaded."""
    loaded, estimates = [], [[SimpleNamespace(time=time) for time in part] for part in parts]
    problem = object.__new__(LiveProblem) if live else SimpleNamespace()
    for name in ("load", "load_live"):
        monkeypatch.setattr(live_module, name, lambda *words, name=name: loaded.append((name, *words)) or problem)
    monkeypatch.setattr(live_module, "has_rig", lambda file: file == "rig.yaml")
    monkeypatch.setattr(live_module, "LiveFollowing", lambda *_: SimpleNamespace(revisions=lambda: iter(estimates)))
    monkeypatch.setattr(live_module, "follow", lambda *_: iter([one for part in estimates for one in part]))
    return loaded


@pytest.mark.parametrize(
    ("words", "loaded"),
    [
        (("mass.yaml",), ("load", "mass.yaml", None)),
        (("mass.yaml", "b.csv"), ("load", "mass.yaml", "b.csv")),
        (("rig.yaml",), ("load_live", "rig.yaml", None)),
        (("rig.yaml", "b.csv"), ("load", "rig.yaml", "b.csv")),
        (("mass.yaml", None, "udp://h:1"), ("load_live", "mass.yaml", "udp://h:1")),
    ],
)
def test_a_recording_or_a_rig_is_followed(monkeypatch, words, loaded):
    found = make(monkeypatch, [], live=False)
    Following(*words)
    assert found == [loaded]


@pytest.mark.parametrize(
    ("parts", "kept"),
    [
        ([[1.0, 2.0], [], [2.0, 3.0]], [1.0, 2.0, 3.0]),
        ([[1.0, 2.0, 3.0], [1.5]], [1.0, 1.5]),
        ([[1.0, 2.0], [0.5]], [0.5]),
        ([[1.0], [2.0], [3.0]], [1.0, 2.0, 3.0]),
    ],
)
def test_late_measurements_replace_estimates(monkeypatch, parts, kept):
    """All are given out; the latest ones are kept, in the order of time. An iteration begins anew."""
    make(monkeypatch, parts, live=True)
    own = Following("rig.yaml")
    for _ in range(2):
        assert [one.time for one in own] == [time for part in parts for time in part]
        assert [one.time for one in own.estimates] == kept
        monkeypatch.setattr(
            live_module,
            "LiveFollowing",
            lambda *_: SimpleNamespace(revisions=lambda: iter([[SimpleNamespace(time=t) for t in p] for p in parts])),
        )


def test_estimates_of_a_recording_come_one_by_one(monkeypatch):
    make(monkeypatch, [[1.0, 2.0]], live=False)
    own = Following("mass.yaml")
    first = next(iter(own))
    assert (first.time, [one.time for one in own.estimates]) == (1.0, [1.0])


@pytest.mark.slow  # what it imports takes a second
def test_estimates_are_a_dataset(monkeypatch):
    """With the units of their signals."""
    make(monkeypatch, [[1.0, 2.0]], live=False)
    own = Following("mass.yaml")
    with pytest.raises(SimulationError, match=r"there is no estimate yet\. Iterate first"):
        own.to_xarray()
    list(own)
    signals = SimpleNamespace(time=np.array([1.0, 2.0]), values={"a.x": np.array([3.0, 4.0])})
    columns = [SimpleNamespace(name="a.x", unit="m", description="place")]
    monkeypatch.setattr(live_module, "signals_of", lambda problem, estimates: (signals, columns))
    found = own.to_xarray()
    assert found["a.x"].values.tolist() == [3.0, 4.0]
    assert found["a.x"].attrs == {"units": "m", "long_name": "place"}
    assert (found["time"].values.tolist(), found["time"].attrs) == ([1.0, 2.0], {"units": "s"})


@every_case(
    ("signal", "sent", "value", "converted"),
    [
        (LiveSignal("x", "mm", "a.x", "m"), "", 3.0, 0.003),
        (LiveSignal("x", "mm", "a.x", "m"), "cm", 3.0, 0.03),  # what the source sends counts
        (LiveSignal("x", "mm", "a.x", "m", factor=-2.0, offset=0.5), "", 250.0, 0.0),
        (LiveSignal("T", "degC", "a.T", "K"), "", 20.0, 293.15),
        (LiveSignal("T", "degC", "a.T", "K", factor=2.0, offset=-1.0), "", 0.0, 545.3),
        (LiveSignal("n", "", "a.n", ""), "", 7.0, 7.0),
    ],
)
def test_values_become_those_of_the_variable(signal, sent, value, converted):
    """By their unit first, also its offset; then by the factor and the offset of the file."""
    assert signal.converted(value, sent) == pytest.approx(converted)


def test_a_unit_that_does_not_convert():
    signal = LiveSignal("x", "mm", "a.x", "m")
    assert signal.converted(1.0, "N") == "arrives in N, a.x is in m"
    assert LiveSignal("n", "", "a.n", "").converted(1.0, "mm") == "arrives in mm, a.n is in no unit"


@pytest.mark.parametrize(("step", "ticks"), [(1.0, 1), (0.4, 2), (0.26, 4), (4.0, 1)])
def test_idle_steps_fill_the_idle_time(monkeypatch, step, ticks):
    monkeypatch.setattr(live_problem, "IDLE", 1.0)
    assert idle_ticks(SimpleNamespace(step_ns=round(step * 1000) * MS)) == ticks


def test_whether_a_file_names_a_rig(tmp_path):
    for text, expected in (("rig: udp://127.0.0.1:1\n", True), ("data: a.csv\n", False)):
        (tmp_path / "a.yaml").write_text(text)
        assert has_rig(tmp_path / "a.yaml") is expected
