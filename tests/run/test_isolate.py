"""A member in a process of its own: the same bits, and its end is not that of the others."""

from __future__ import annotations

import os
import re
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.run.endings import MODES, ending_fmu
from tests.run.test_endings import ENDS, results
from twin.component import Component, PythonComponent, input, local, output, parameter
from twin.coupling import Connection, CoSimulation, IsolatedMember, RecordMember, System
from twin.errors import CouplingError
from twin.fmi import FMUMember, exporter
from twin.run import run_scenario
from twin.scenario import Form, parse_scenario, part

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="a member is isolated by fork")


class Mixed(Component):
    """Variables of several types, an array among them."""

    period = 1e-3

    u = input("1", "what is weighed", start=0.5)
    count = input("1", "a whole number", type="Int32")
    gain = parameter(0.75, "1", "weight")
    y = output("1", "sum and product", shape=(3,))
    total = output("1", "sum of whole numbers", type="Int32")
    even = output("1", "whether that is even", type="Boolean")
    inner = local(0.0, "1", "mean")

    def step(self, t, h):
        self.inner = self.gain * self.inner + (1.0 - self.gain) * self.u
        self.y[0] = self.u + self.inner
        self.y[1] = self.u * self.inner
        self.y[2] = t + h
        self.total = self.total + self.count + 1
        self.even = self.total % 2 == 0


class Spoils(Component):
    """Is infinite from 20 ms on."""

    period = 1e-3

    y = output("1", "one, then infinite")

    def step(self, t, h):
        self.y = 1.0
        if t > 0.0195:
            self.y = 1e308 * 1e308


class Leaves(PythonComponent):
    """Ends its process where `when` says, or fails there; tells its process."""

    period = 1e-3

    when = parameter(0, "1", "1: initialization, 2: step, 3: termination, 4: an error in a step", type="Int32")
    pid = output("1", "process", type="Int64")

    def initialize(self):
        self.pid = os.getpid()
        if self.when == 1:
            os._exit(5)

    def step(self, t, h):
        self.pid = os.getpid()
        if t > 0.0025 and self.when == 2:
            os._exit(5)
        if t > 0.0025 and self.when == 4:
            raise ValueError("no more")

    def close(self):
        if self.when == 3:
            os._exit(5)


SCENARIO = """
    stop_time: 50 ms
    members:
      a: {{component: "tests.run.test_isolate:Mixed", parameters: {{u: 0.3}}{0}}}
      b: {{component: "tests.run.test_isolate:Mixed", communication_step: 5 ms, finite: false{0}}}
      c: {{component: "tests.run.test_isolate:Mixed"}}
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


def signals(text: str, form: Form, build: Path, folder: Path) -> dict[str, np.ndarray]:
    outcome = run_scenario(parse_scenario(text), form, root=folder, build=build, report=False)
    assert outcome.run.status == "completed", outcome.run.reason
    return outcome.tables["base", 0].values


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("form", list(Form))
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


def test_what_is_not_finite_is_found_in_an_isolated_member_too(build, tmp_path):
    text = '{stop_time: 50 ms, members: {m: {component: "tests.run.test_isolate:Spoils", isolate: true}}}'
    outcome = run_scenario(parse_scenario(text), Form.compiled, root=tmp_path, build=build, report=False)
    assert "m.y is inf at t = 21 ms, with finite inputs." in outcome.summary["reason"]


def test_each_has_a_process_that_ends_with_the_simulation(build):
    before = left()
    members = {name: IsolatedMember(RecordMember(name, Leaves(), identity={}), build) for name in ("one", "two")}
    simulated = CoSimulation(
        members, System({n: m.variables for n, m in members.items()}, []).links(), 1_000_000, build=build
    )
    simulated.initialize(0)
    simulated.advance(40_000_000)
    pids = {int(member.get("pid")) for member in members.values()}
    assert len(pids | {os.getpid()}) == 3
    simulated.terminate()
    assert left() == before
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


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
        members: {{m: {{component: "tests.run.test_isolate:Leaves", isolate: true}}}}
        variants: {{ill: {{members: {{m: {{parameters: {{when: {when}}}}}}}}}, well: {{}}}}
    """
    outcome = run_scenario(parse_scenario(text), root=tmp_path, build=build, report=False)
    assert re.sub(r"\S+\.py:\d+: ", "", outcome.summary["reason"]) == f"ill, seed 0: {reason}"
    assert [case["complete"] for case in outcome.summary["cases"]] == [False, True]
    tables = outcome.tables
    assert (len(tables["ill", 0].time), len(tables["well", 0].time)) == (rows, 11)
    assert tables["well", 0].values["m.pid"][-1] != os.getpid()
    assert left()[0] == before[0]
    assert left()[1] <= before[1]


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
          b: {{component: "tests.run.test_isolate:Leaves", communication_step: 100 ms}}
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


def test_an_isolated_process_dies_with_the_one_that_forked_it(build, fmu):
    inner = FMUMember("a", fmu, {"mode": MODES["hang"]})
    out, back = os.pipe()
    child = os.fork()
    if child == 0:
        member = IsolatedMember(inner, build)
        member.instantiate()
        member.enter_initialization(0.0, None)
        member.exit_initialization()
        os.write(back, f"{member._pid}\n".encode())
        members = {"a": member}
        simulated = CoSimulation(members, System({"a": member.variables}, []).links(), 1_000_000, build=build)
        simulated._fill(None)
        simulated.advance(400_000_000)
        os._exit(0)
    pid = int(os.read(out, 20))
    time.sleep(0.1)
    os.kill(child, 9)
    os.waitpid(child, 0)
    inner.close()
    os.close(out)
    os.close(back)
    end = time.monotonic() + 20
    while Path(f"/proc/{pid}").exists() and " Z " not in Path(f"/proc/{pid}/stat").read_text():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_no_member_of_a_group_is_isolated():
    text = '{stop_time: 5 ms, members: {m: {component: "tests.run.test_isolate:Mixed", isolate: true}}}'
    with pytest.raises(
        CouplingError, match=r"member 'm' has `isolate: true`, and a group is one piece of code\. Remove"
    ):
        part(parse_scenario(text), ["m"], None)


def test_connections_between_isolated_members_cost_no_messages(build):
    members = {name: IsolatedMember(RecordMember(name, Mixed(), identity={}), build) for name in ("a", "b")}
    wires = [Connection("a.y[1]", "b.u"), Connection("b.total", "a.count")]
    simulated = CoSimulation(
        members, System({n: m.variables for n, m in members.items()}, wires).links(), 1_000_000, build=build
    )
    simulated.initialize(0)
    simulated.advance(1_000_000)
    counts = [member._count for member in members.values()]
    simulated.advance(2_000_000_000)
    after = [member._count for member in members.values()]
    simulated.terminate()
    assert max(after) - min(counts) < 1000  # but for looks at what is finite, every 50 ms


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
