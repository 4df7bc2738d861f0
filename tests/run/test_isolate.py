"""A member in a process of its own: the same bits, and its end is not that of the others."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.run.endings import MODES, ending_fmu
from tests.run.isolated_parts import Leaves, Mixed
from tests.run.test_endings import ENDS, results
from twin import compiler
from twin.component import PythonComponent, output, resampled
from twin.coupling import Connection, CoSimulation, CoupledSystem, IsolatedMember, RecordMember
from twin.errors import CouplingError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario, part

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="a member is isolated by POSIX")


SCENARIO = """
    stop_time: 50 ms
    members:
      a: {{component: "tests.run.isolated_parts:Mixed", parameters: {{u: 0.3}}{0}}}
      b: {{component: "tests.run.isolated_parts:Mixed", communication_step: 5 ms, finite: false{0}}}
      c: {{component: "tests.run.isolated_parts:Mixed"}}
    connections:
      - {{from: "a.y[1]", to: b.u}}
      - {{from: b.total, to: a.count}}
      - {{from: "b.y[2]", to: c.u}}
    events:
      - {{at: 20 ms, set: {{a.u: 0.7, a.gain: 0.5}}}}
      - {{at: 30 ms, override: {{"a.y[1]": 2.0}}}}
      - {{at: 40 ms, release: ["a.y[1]"]}}
    record: {{variables: ["*"]}}
"""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return ending_fmu(tmp_path_factory.mktemp("fmu"))


def left() -> tuple[list[int], set[str]]:
    """Children of this process, and its open files."""
    own = Path("/proc/self")
    if not own.exists():
        return [], set()
    children = (own / "task" / str(os.getpid()) / "children").read_text().split()
    return [int(one) for one in children], {one.name for one in (own / "fd").iterdir()}


def signals(text: str, form: Backend, build: Path, folder: Path) -> dict[str, np.ndarray]:
    outcome = run_scenario(parse_scenario(text), RunOptions(backend=form, root=folder, build=build, report=False))
    assert outcome.run.status == "completed", outcome.run.reason
    return outcome.tables["base", 0].values


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", [pytest.param("jacobi", marks=pytest.mark.slow), "gauss_seidel"])
@pytest.mark.parametrize("form", list(Backend))
def test_isolated_members_give_the_same_bits(form, algorithm, build, tmp_path):
    text = f"algorithm: {algorithm}\n" + SCENARIO.replace("\n    ", "\n")
    together = signals(text.format(""), form, build, tmp_path)
    before = left()
    apart = signals(text.format(", isolate: true"), form, build, tmp_path)
    assert left()[0] == before[0]
    assert left()[1] <= before[1]
    assert list(apart) == list(together)
    for name, values in together.items():
        assert values.dtype == apart[name].dtype
        assert values.tobytes() == apart[name].tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_values_of_every_type_go_across(version, build):
    inner = FMUMember("m", exporter.build(Mixed, version, build))
    member = IsolatedMember(inner, build)
    plain = FMUMember("m", exporter.build(Mixed, version, build))
    for one in (member, plain):
        one.instantiate()
        one.set("u", 0.1)
        one.enter_initialization(0.0, None)
        one.set("count", 3)
        one.exit_initialization()
    for name in plain.variables:
        mine, theirs = member.get(name), plain.get(name)
        assert np.array_equal(mine, theirs)
        assert np.asarray(mine).dtype == np.asarray(theirs).dtype
    folder = inner._unpacked.folder
    member.close()
    assert folder.exists()  # the other one uses it
    plain.close()
    member.close()
    assert not folder.exists()


@pytest.mark.slow
def test_what_is_not_finite_is_found_in_an_isolated_member_too(build, tmp_path):
    text = '{stop_time: 50 ms, members: {m: {component: "tests.run.isolated_parts:Spoils", isolate: true}}}'
    outcome = run_scenario(
        parse_scenario(text), RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False)
    )
    assert "m.y is inf at t = 21 ms (in its step from 20 ms to 21 ms), with finite inputs." in outcome.summary["reason"]


@pytest.mark.slow
def test_each_has_a_process_that_ends_with_the_simulation(build):
    before = left()
    members = {name: IsolatedMember(RecordMember(name, Leaves(), identity={}), build) for name in ("one", "two")}
    simulated = CoSimulation(
        members, CoupledSystem({n: m.variables for n, m in members.items()}, []).links(), 1_000_000, build=build
    )
    simulated.initialize(0)
    simulated.advance(40_000_000)
    pids = {int(member.get("pid")) for member in members.values()}
    assert len(pids | {os.getpid()}) == 3
    simulated.terminate()
    assert left() == before
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("when", "reason", "rows"),
    [
        (1, "m: ended the process with exit code 5 in initialization.", 0),
        (2, "m: ended the process with exit code 5 in step, in the step from t = 3 ms.", 4),
        (3, "m: ended the process with exit code 5 in termination.", 11),
        (4, "m: failed with ERROR in the step from t = 3 ms. Last inputs: none. Last log: ValueError: no more", 4),
    ],
)
def test_an_end_anywhere_ends_the_case_and_no_other(when, reason, rows, build, tmp_path):
    before = left()
    text = f"""
        stop_time: 10 ms
        members: {{m: {{component: "tests.run.isolated_parts:Leaves", isolate: true}}}}
        variants: {{ill: {{members: {{m: {{parameters: {{when: {when}}}}}}}}}, well: {{}}}}
    """
    outcome = run_scenario(parse_scenario(text), RunOptions(root=tmp_path, build=build, report=False))
    assert re.sub(r"\S+\.py:\d+: ", "", outcome.summary["reason"]) == f"ill, seed 0: {reason}"
    assert [case["complete"] for case in outcome.summary["cases"]] == [False, True]
    tables = outcome.tables
    assert (len(tables["ill", 0].time), len(tables["well", 0].time)) == (rows, 11)
    assert tables["well", 0].values["m.pid"][-1] != os.getpid()
    assert left()[0] == before[0]
    assert left()[1] <= before[1]


@pytest.mark.slow
def test_an_isolated_fmu_may_end_its_process_and_the_run_goes_on_in_the_same(tmp_path, build, command_line, fmu):
    variants = ", ".join(
        f"{name}: {{members: {{a: {{parameters: {{mode: {mode}}}}}}}}}" for name, mode in MODES.items()
    )
    (tmp_path / "s.yaml").write_text(f"""
        title: ends
        stop_time: 1 s
        step: 100 ms
        members:
          a: {{component: {fmu}, isolate: true}}
          b: {{component: "tests.run.isolated_parts:Leaves", communication_step: 100 ms}}
        variants: {{first: {{}}, {variants}, last: {{}}}}
        record: {{variables: ["a.y*", b.pid]}}
    """)
    words = ["run", "s.yaml", "--build", str(build), "--no-report", "--timeout", "0.5"]
    done = command_line.run(words, tmp_path)
    assert done.returncode == 1
    summary, cases = results(tmp_path)
    assert summary["status"] == "failed"
    assert summary["reason"].splitlines() == [f"{name}, seed 0: a: {text}" for name, text in ENDS.items()]
    assert {case[0]: len(one.time) for case, one in cases.items()} == {
        "first": 11,
        "crash": 4,
        "abort": 4,
        "exit": 4,
        "hang": 4,
        "last": 11,
    }
    assert done.stderr.count("native: the end is near") == 8  # printed once, and told once
    processes = {case[0]: int(one.values["b.pid"][-1]) for case, one in cases.items()}
    assert len({processes[name] for name in ("first", "crash", "abort", "exit", "hang")}) == 1
    assert processes["last"] != processes["hang"]  # `--timeout` ended that one


DIES = """
import sys
from pathlib import Path
from tests.run.endings import MODES
from twin.coupling import CoSimulation, IsolatedMember, CoupledSystem
from twin.fmi import FMUMember

fmu, build = map(Path, sys.argv[1:])
member = IsolatedMember(FMUMember("a", fmu, {"mode": MODES["hang"]}), build)
simulated = CoSimulation({"a": member}, CoupledSystem({"a": member.variables}, []).links(), 100_000_000, build=build)
simulated.initialize(0)
print(member._process.pid, flush=True)
simulated.advance(400_000_000)
"""


@pytest.mark.slow
def test_an_isolated_process_dies_with_the_one_that_started_it(build, fmu):
    line = [sys.executable, "-c", DIES, str(fmu), str(build)]
    with subprocess.Popen(line, cwd=ROOT, stdout=subprocess.PIPE, text=True) as program:
        pid = int(program.stdout.readline())
        time.sleep(0.1)
        assert Path(f"/proc/{pid}").exists()
        program.kill()
    end = time.monotonic() + 20
    while Path(f"/proc/{pid}").exists() and " Z " not in Path(f"/proc/{pid}/stat").read_text():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.mark.slow
def test_no_process_with_threads_is_forked(build, monkeypatch, recwarn):
    """A fork copies one thread, and the locks that the others hold: neither Python nor C libraries go on from there."""

    def fork():
        raise AssertionError("forked")

    for name in ("fork", "forkpty"):
        monkeypatch.setattr(os, name, fork)
    is_over = threading.Event()
    other = threading.Thread(target=is_over.wait)
    other.start()
    try:
        member = IsolatedMember(RecordMember("m", Mixed(), identity={}), build)
        member.instantiate()
        assert int(Path(f"/proc/{member._process.pid}/stat").read_text().rsplit(")", 1)[1].split()[1]) == os.getpid()
        member.close()
    finally:
        is_over.set()
        other.join()
    assert not recwarn.list


@pytest.mark.slow
def test_every_fork_is_of_a_process_with_one_thread(build, tmp_path):
    """The supervisor of a command forks: at its start, while nothing else runs. Native threads count too."""
    (tmp_path / "sitecustomize.py").write_text(COUNTS_THREADS)
    (tmp_path / "s.yaml").write_text(ISOLATED)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "FORKS": str(tmp_path / "forks")}
    words = ["run", "s.yaml", "--build", str(build), "--no-report"]
    line = [sys.executable, "-W", "error::DeprecationWarning:twin", "-c", "from twin.cli import main; main()", *words]
    done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set((tmp_path / "forks").read_text().split()) == {"1"}


COUNTS_THREADS = """
import os

fork = os.fork

def counted():
    with open(os.environ["FORKS"], "a") as file:
        file.write(f"{len(os.listdir('/proc/self/task'))}\\n")
    return fork()

os.fork = counted
"""
ISOLATED = """
title: isolated
stop_time: 5 ms
members:
  a: {component: "tests.run.isolated_parts:Mixed", isolate: true}
  b: {component: "tests.run.isolated_parts:Mixed", isolate: true}
variants: {one: {}, two: {}}
"""


def test_a_class_that_another_process_cannot_import(build):
    class Local(PythonComponent):
        """Defined in a function."""

        y = output("1", "nothing")

    before = left()
    with pytest.raises(CouplingError, match=r"m: another process cannot make it: .*Local.*Define its class at the top"):
        IsolatedMember(RecordMember("m", Local(), identity={}), build)
    script = type("Script", (PythonComponent,), {"__module__": "__main__", "y": output("1", "y"), "__doc__": "S."})
    with pytest.raises(CouplingError, match=r"m: another process cannot make it: .*is in the script that runs"):
        IsolatedMember(RecordMember("m", script(), identity={}), build)
    assert left() == before


@pytest.mark.slow
@pytest.mark.parametrize("has_code", [False, True])
def test_a_component_at_another_period_keeps_it(has_code, build):
    cls = resampled(Mixed, 5_000_000)
    code = compiler.load_component(cls, build) if has_code else None
    member = IsolatedMember(RecordMember("m", cls(u=0.25), code), build)
    simulated = CoSimulation({"m": member}, [], 1_000_000, build=build)
    simulated.initialize(0)
    simulated.advance(12_000_000)
    values = simulated.recording().signals
    simulated.terminate()
    assert values["m.total"].tolist() == [0] * 5 + [1] * 5 + [2] * 3


def test_no_member_of_a_group_is_isolated():
    text = '{stop_time: 5 ms, members: {m: {component: "tests.run.isolated_parts:Mixed", isolate: true}}}'
    with pytest.raises(
        CouplingError, match=r"member 'm' has `isolate: true`, and a group is one piece of code\. Remove"
    ):
        part(parse_scenario(text), ["m"], None)


@pytest.mark.slow
def test_connections_between_isolated_members_cost_no_messages(build):
    members = {name: IsolatedMember(RecordMember(name, Mixed(), identity={}), build) for name in ("a", "b")}
    wires = [Connection("a.y[1]", "b.u"), Connection("b.total", "a.count")]
    simulated = CoSimulation(
        members, CoupledSystem({n: m.variables for n, m in members.items()}, wires).links(), 1_000_000, build=build
    )
    simulated.initialize(0)
    simulated.advance(1_000_000)
    counts = [member._count for member in members.values()]
    simulated.advance(2_000_000_000)
    after = [member._count for member in members.values()]
    simulated.terminate()
    assert max(after) - min(counts) < 1000  # but for looks at what is finite, every 50 ms


@pytest.mark.slow
def test_an_fmu_that_allows_one_instance_per_process_has_several(tmp_path, build, fmu):
    path = tmp_path / "Native.fmu"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            flag = b'<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'
            new.writestr(
                name, old.read(name).replace(b"<CoSimulation", flag) if name.endswith(".xml") else old.read(name)
            )
    members = {name: IsolatedMember(FMUMember(name, path), build) for name in ("a", "b")}
    simulated = CoSimulation(members, [], 100_000_000, build=build)
    simulated.initialize(0)
    simulated.advance(500_000_000)
    values = simulated.recording().signals
    simulated.terminate()
    assert values["a.y"].tobytes() == values["b.y"].tobytes()
    assert values["a.y"][-1].tolist() == [0.5, 1.0]
