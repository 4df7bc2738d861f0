"""Why a run did not complete, from the ends of its cases; and which members are FMUs."""

from types import SimpleNamespace

import pytest

from twin.run import build_simulation, cases
from twin.run.recovery import finalize_dead_cases
from twin.scenario import Backend


@pytest.mark.parametrize(
    ("failure", "interrupted", "expected"),
    [
        ("", False, ("completed", "")),
        ("", True, ("interrupted", "interrupted in PI, seed 1")),
        ("PI, seed 1: the run was killed.", True, ("interrupted", "PI, seed 1: the run was killed.")),
        ("PI, seed 1: plant crashed.", False, ("failed", "PI, seed 1: plant crashed.")),
    ],
)
def test_the_reason_of_a_recovered_run(monkeypatch, failure, interrupted, expected):
    monkeypatch.setattr("twin.run.recovery.apply_analyses", lambda *_: None)
    reasons = [("completed", "")]
    end = {"end": 0, "complete": False, "failure": failure, "interrupted": interrupted, "took": 0.0, "last": None}
    recording = SimpleNamespace(
        case_recordings=[SimpleNamespace(number=0, end=end)], cases=[("PI", 1)], signals=lambda _number: None
    )
    result = SimpleNamespace(
        run=SimpleNamespace(wall_time=0.0, members={}, extra={}, status="interrupted"),
        scenario=None,
        add_signals=lambda *_args, **_options: None,
        mark_incomplete=lambda *reason: reasons.append(reason),
    )
    executor = SimpleNamespace(
        result=result,
        channel=SimpleNamespace(crash_report=None),
        callbacks=SimpleNamespace(progress=None),
        cases=["first"],
    )
    assert finalize_dead_cases(executor, recording) == []
    assert reasons[-1] == expected


@pytest.mark.parametrize(
    ("is_isolated", "is_group", "expected"),
    [
        (False, False, Backend.interpreted),
        (True, False, Backend.interpreted),
        (False, True, Backend.interpreted),
        (True, True, Backend.fmu),
    ],
)
def test_a_group_in_a_process_of_its_own_is_an_fmu(monkeypatch, build, is_isolated, is_group, expected):
    """Any other member is what was asked for."""
    backends = []

    def refuse(_name, _component, _values, backend, *_rest):
        backends.append(backend)
        raise KeyError("enough")

    monkeypatch.setattr(cases, "members", SimpleNamespace(component_of=lambda _spec: None, make=refuse))
    case = SimpleNamespace(
        members={"wall": SimpleNamespace(isolate=is_isolated, made=is_group, exchange=None, names=None, units=None)},
        values=lambda *_: {},
    )
    with pytest.raises(KeyError):
        build_simulation(case, {"wall": {}}, Backend.interpreted, build)
    assert backends == [expected]
