"""Systems without a file, step by step."""

import gc
import linecache
import sys

import numpy as np
import pytest

import twin
from tests.face.parts import Fails, Slow, Types
from twin import coupling
from twin.errors import CouplingError, ScenarioError, SimulationError, TwinError, UnknownNameError


@pytest.fixture
def system():
    made = twin.System()
    made.add("part", Types, gain="3 mm/N")
    return made


def problem(call, kind=ScenarioError):
    with pytest.raises(kind) as caught:
        call()
    assert caught.value.problems == str(caught.value).split("\n")
    return str(caught.value)


def test_values_have_units_and_types(system, build):
    with system.simulate(backend="interpreted", build=build) as simulation:
        simulation["part.push"] = "2000 mN"
        assert simulation.advance("3 ms") == simulation.time == 0.003
        assert simulation["part.place"] == pytest.approx(6e-3)
        assert simulation["part.gain"] == 3e-3
        assert (simulation["part.count"], simulation["part.odd"]) == (3, True)
        assert [type(simulation[f"part.{name}"]) for name in ("place", "count", "odd")] == [float, int, bool]
        np.testing.assert_allclose(simulation["part.row"], [6e-3, 1.006, 2.006])
        assert simulation["part.row[2]"] == pytest.approx(1.006)
        simulation["part.gain"] = np.float64(1.0)
        simulation.advance()
        assert simulation["part.place"] == 2.0
        simulation.advance(until="10 ms")
        assert simulation.time == 0.01
    results = simulation.results
    assert list(results) == [
        "time",
        "part.place",
        "part.count",
        "part.odd",
        "part.row[1]",
        "part.row[2]",
        "part.row[3]",
    ]
    assert results.attrs["units"]["part.place"] == "m"
    assert [results[name].dtype.kind for name in ("part.count", "part.odd")] == ["i", "b"]
    assert results.time.iloc[-1] == 0.01


def test_all_forms_do_the_same(system, build):
    tables = []
    for form in ("interpreted", "compiled", "fmu"):
        with system.simulate(backend=form, build=build) as simulation:
            simulation["part.push"] = 0.1
            simulation.advance("5 ms")
            assert [type(simulation[f"part.{name}"]) for name in ("place", "count", "odd")] == [float, int, bool]
            assert simulation["part.row"].shape == (3,)
        tables.append(simulation.results)
    assert all(table.equals(tables[0]) for table in tables)


def test_what_is_set_is_read_back_at_once(build):
    """Also of a member that steps later, which uses and records it from its next step."""
    system = twin.System()
    system.add("slow", Slow)
    for backend in ("interpreted", "compiled"):
        with system.simulate(backend=backend, build=build, record=["slow.gain"]) as simulation:
            simulation.advance("13 ms")
            simulation["slow.gain"] = "2000 mN"
            assert simulation["slow.gain"] == 2.0
            simulation.advance("20 ms")
            assert simulation["slow.gain"] == 2.0
        assert simulation.results["slow.gain"].tolist() == [1.0] * 20 + [2.0] * 14
        with pytest.raises(twin.TwinError, match="with `live` or `simulate`"):
            simulation.advance()


def test_what_is_slow_is_seen_when_it_is_due(build):
    system = twin.System()
    system.add("slow", Slow)
    system.add("part", Types)
    system.connect("slow.value", "part.push")
    for form in ("interpreted", "compiled"):
        with system.simulate(backend=form, build=build) as simulation:
            seen = []
            for _ in range(21):
                seen.append(simulation["slow.value"])
                simulation.advance()
        assert seen == [0.0] * 10 + [1.0] * 10 + [2.0]


def test_problems_are_told_at_once_and_change_nothing(system):
    assert "no component" in problem(lambda: system.add("other", "servomotr"))
    assert "Did you mean `push`" in problem(lambda: system.add("other", Types, pusch=1))
    assert "does not convert" in problem(lambda: system.add("other", Types, gain="3 kg"))
    assert "already" in problem(lambda: system.add("part", Types))
    assert "not a component" in problem(lambda: system.add("other", int))
    assert "there is no file" in problem(lambda: system.add("other", "missing.fmu"))
    assert "Did you mean 'part'" in problem(lambda: system.connect("prt.place", "part.push"))
    assert "does not convert" in problem(lambda: system.connect("part.place", "part.push"))
    assert "Only numbers" not in problem(lambda: system.connect("part.row", "part.push"))
    assert system.members == {"part": "tests.face.parts:Types"}
    assert system.connections == []
    assert "step" in problem(lambda: system.simulate(step="1 m"), twin.TwinError)
    assert "backend" in problem(lambda: system.simulate(backend="fast"), twin.TwinError)


def test_what_cannot_be_set_says_so(system, build):
    system.add("other", Types)
    system.add("angle", "chirp")
    with system.simulate(backend="interpreted", build=build) as simulation:
        for name, value, text in (
            ("part.mass", 2.0, "fixed"),
            ("part.place", 2.0, "override"),
            ("part.gain", "3 kg", "convert"),
            ("part.push", [1, 2], "one value"),
            ("part.push", float("nan"), "finite"),
            ("part.push", None, "nothing"),
        ):
            with pytest.raises(twin.TwinError, match=text):
                simulation[name] = value
        with pytest.raises(
            UnknownNameError, match=r"'part' is a member\. Name a variable of it, such as part\.place, "
        ):
            simulation["part"]
        for name in ("part.psh", "prt.push", "part", "part.row[4]"):
            with pytest.raises(UnknownNameError):
                simulation[name]
        with pytest.raises(KeyError):
            simulation["part.psh"]
        with pytest.raises(twin.TwinError, match="no multiple of the step, 1 ms"):
            simulation.advance("0.5 ms")
        with pytest.raises(twin.TwinError, match="cannot go back"):
            simulation.advance("-1 ms")
        with pytest.raises(twin.TwinError, match="not a time"):
            simulation.advance("soon")
    with pytest.raises(twin.TwinError, match="closed"):
        simulation.advance()
    with pytest.raises(twin.TwinError, match="closed"):
        simulation["part.place"]


def test_an_override_holds_until_it_is_released(build):
    system = twin.System()
    system.add("wave", "heart")
    system.add("drive", "servomotor", mode_of_operation=8)
    system.connect("wave.position", "drive.target_position")
    with system.simulate(backend="compiled", build=build) as simulation:
        with pytest.raises(CouplingError, match="connected"):
            simulation["drive.target_position"] = 1.0
        simulation.override("drive.target_position", "20 mm")
        simulation.advance("2 s")
        assert simulation["drive.position"] == pytest.approx(0.02, abs=1e-3)
        assert "; overridden drive.target_position>" in repr(simulation)
        simulation.release("drive.target_position")
        assert "overridden" not in repr(simulation)
        with pytest.raises(TwinError, match=r"drive\.target_position is not overridden\. Nothing is\."):
            simulation.release("drive.target_position")
        simulation.override("wave.position", "20 mm")
        simulation.advance("1 s")
        given = {simulation["wave.position"], simulation["drive.target_position"]}
        assert given == {simulation.results["wave.position"].iloc[-1], 0.02} == {0.02}
        simulation.release("wave.position")
    figure = simulation.plot("wave.position", "drive.position - wave.position", interactive=False)
    assert [len(axis.lines) for axis in figure.axes] == [2]
    with pytest.raises(
        UnknownNameError, match=r"simulation: 'wave\.postion' was not recorded\. Did you mean 'wave\.position'"
    ):
        simulation.plot("wave.postion")
        simulation.advance("2 s")
        assert abs(simulation["drive.position"]) < 0.015


@pytest.mark.slow
def test_a_failure_keeps_what_was_recorded_and_frees_all(build):
    system = twin.System()
    system.add("weak", Fails)
    before = Fails.closed
    with pytest.raises(SimulationError, match="worn out") as caught, system.simulate(build=build) as simulation:
        simulation.advance("1 s")
    assert "weak" in caught.value.problems[0]
    assert Fails.closed == before + 1
    assert simulation.results["weak.value"].tolist() == [0.0, 0.0, 0.001, 0.002]
    assert "worn out" in simulation.reason

    forgotten = system.simulate(build=build)
    assert forgotten.time == 0.0
    del forgotten
    gc.collect()
    assert Fails.closed == before + 2


TEXT = '''
from twin.component import Component, input, output

class Cell(Component):
    """Doubles."""
    u = input("1", "number")
    y = output("1", "twice the number")

    def step(self, t, h):
        self.y = {factor} * self.u
'''


@pytest.mark.slow
def test_a_class_of_a_cell_is_compiled_and_one_of_exec_is_not(build, tmp_path):
    def defined(factor, name):
        text, scope = TEXT.format(factor=factor), {"__name__": "__main__"}
        if name:
            linecache.cache[name] = len(text), None, text.splitlines(keepends=True), name
        exec(compile(text, name or "<string>", "exec"), scope)
        return scope["Cell"]

    for factor, name, notes in ((2, "cell 1", 0), (3, "cell 2", 0), (4, "", 1)):
        cls = defined(factor, name)
        system = twin.System()
        system.add("cell", cls)
        with system.simulate(build=build) as simulation:
            simulation["cell.u"] = 1.0
            simulation.advance()
            assert simulation["cell.y"] == factor
            assert len(simulation.notes) == notes
        if name:
            path = twin.export(cls, tmp_path / f"{factor}.fmu", build=build)
            assert twin.simulate(path, {"time": [0.0], "u": [1.0]}, stop_time=1.0).y.iloc[-1] == factor
        else:
            with pytest.raises(twin.TwinError, match="source cannot be found"):
                twin.export(cls, tmp_path / "none.fmu", build=build)


def test_the_picture_names_all_members(system):
    system.add("wave", "heart")
    assert "wave" in system._repr_html_()
    assert "without members" in repr(twin.System())
    assert twin.System()._repr_html_()


def test_importing_twin_imports_nothing_else():
    import subprocess

    code = "import sys, twin; print([m for m in ('numpy', 'pandas', 'yaml', 'matplotlib', 'twin.face') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    with pytest.raises(AttributeError):
        twin.lode  # noqa: B018


def test_completion_shows_public_names_alone():
    assert {name for name in dir(twin) if not name.startswith("_")} == set(twin.__all__)
    assert all(callable(getattr(twin, name)) for name in twin.__all__)
    assert twin.errors.TwinError is twin.TwinError  # what is not shown is still there


def test_former_names_are_accepted_with_a_note(system, build, caplog):
    with system.simulate(form="interpreted", build=build) as simulation:
        simulation.advance("1 ms")
    assert coupling.Link is coupling.ResolvedConnection
    assert [record.getMessage() for record in caplog.records] == [
        "note: form= is now backend=; the old name ends with the next release.",
        "note: twin.coupling.Link is now twin.coupling.ResolvedConnection; the old name ends with the next release.",
    ]
