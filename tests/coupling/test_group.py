"""Any part of a system as one FMU: put back in place of its members it gives the same run to the bit."""

from itertools import product

import fmpy
import fmpy.validation
import numpy as np
import pytest
import yaml
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from tests.every_case import every_case
from tests.matrix import some
from twin.compiler import dependencies
from twin.errors import CouplingError, ScenarioError
from twin.fmi.exporting import exporter
from twin.run import RunOptions, resolve_catalogs, run_scenario
from twin.scenario import Backend, group, load_scenario, parse_scenario

SCENARIO = """
stop_time: 0.5 s
step: 1 ms
algorithm: ALGORITHM
seeds: [1]
members:
  heart:      {component: heart}
  estimate:   {component: heart_estimate}
  controller: {component: pi_bouc_wen_control, parameters: {setpoint: 0.25 N}}
  servomotor: {component: servomotor}
  sheath:     {component: sheath}
  wall:       {component: wall}
  sensor:     {component: force_sensor}
connections:
  - {from: heart.position, to: [estimate.position, wall.heart_position]}
  - estimate.estimated_position -> controller.heart_position
  - sensor.measured_force -> controller.force
  - controller.target_velocity -> servomotor.target_velocity
  - servomotor.position -> sheath.gripper_position
  - sheath.reaction_force -> servomotor.load_force
  - sheath.tip_position -> wall.tip_position
  - {from: wall.force, to: [sheath.contact_force, sensor.force]}
record: ["*.*"]
"""

PARTS = {
    "controller alone": ["controller"],
    "estimate and controller": ["estimate", "controller"],
    "plant": ["heart", "servomotor", "sheath", "wall", "sensor"],
    "sheath and wall": ["sheath", "wall"],
}


def run(text, tmp_path, build):
    outcome = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path / "runs", build=build, report=False)
    )
    assert outcome.run.status == "completed", outcome.run.reason
    return next(iter(outcome.tables.values())).values


def regrouped(text, chosen, path):
    """The scenario with one member `group` in place of the chosen ones; what couples them is compiled in."""
    data = yaml.safe_load(text)
    data["members"] = {name: one for name, one in data["members"].items() if name not in chosen}
    data["members"]["group"] = {"component": str(path)}
    data["connections"] = []
    for connection in parse_scenario(text).variants[0].connections:
        inside = [end.split(".")[0] in chosen for end in (connection.source, connection.target)]
        if not all(inside):
            ends = zip((connection.source, connection.target), inside, strict=True)
            data["connections"].append(" -> ".join(f"group.{end}" if own else end for end, own in ends))
    return yaml.safe_dump(data)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "version"),
    some(product(PARTS, ("2.0", "3.0")), [("estimate and controller", "2.0"), ("plant", "3.0")]),
)
def test_a_group_gives_the_same_run_to_the_bit(name, version, tmp_path, build):
    text = SCENARIO.replace("ALGORITHM", "jacobi")
    scenario = parse_scenario(text)
    case = scenario.cases()[0]
    chosen = PARTS[name]
    path = tmp_path / "group.fmu"
    exporter.export(group("group", case, resolve_catalogs(scenario)[case.variant], chosen), version, path, build)
    whole = run(text, tmp_path, build)
    parted = run(regrouped(text, chosen, path), tmp_path, build)
    compared = 0
    for signal, values in whole.items():
        other = parted.get(signal, parted.get(f"group.{signal}"))
        if other is not None and signal.split(".")[0] not in chosen:
            assert np.asarray(other).tobytes() == np.asarray(values).tobytes(), signal
            compared += 1
    assert compared > 8


@pytest.mark.slow
@pytest.mark.parametrize("name", some([name for name in PARTS if name != "plant"], ["sheath and wall"]))
def test_gauss_seidel_groups_are_equal_to_the_bit(name, tmp_path, build):
    text = SCENARIO.replace("ALGORITHM", "gauss_seidel")
    scenario = parse_scenario(text)
    case, chosen = scenario.cases()[0], PARTS[name]
    path = tmp_path / "group.fmu"
    cls = group("group", case, resolve_catalogs(scenario)[case.variant], chosen)
    exporter.export(cls, "2.0", path, build)
    whole = run(text, tmp_path, build)
    parted = run(regrouped(text, chosen, path), tmp_path, build)
    for signal in ("wall.force", "servomotor.current", "sensor.measured_force"):
        other = parted.get(signal, parted.get(f"group.{signal}"))
        assert np.asarray(other).tobytes() == np.asarray(whole[signal]).tobytes(), signal


LOOP = """
stop_time: 10 ms
members:
  a: {component: "tests.coupling.group_parts:Gain", parameters: {gain: 0.5}}
  b: {component: "tests.coupling.group_parts:Gain", parameters: {gain: 0.5}}
  c: {component: "tests.coupling.group_parts:Gain"}
  p: {component: "tests.coupling.group_parts:Watch"}
connections: [a.y -> b.u, b.y -> a.u, b.y -> c.u, c.y -> p.u]
"""
REFUSED = {
    "controller between": (
        SCENARIO.replace("ALGORITHM", "gauss_seidel"),
        PARTS["plant"],
        r"gauss_seidel estimate steps after .* before servomotor",
    ),
    "sheeth": (SCENARIO, ["sheeth"], r"there is no member 'sheeth'\. Did you mean 'sheath'"),
    "loop cut": (LOOP, ["a", "c"], r"algebraic loop through a\.y, b\.y crosses the border.* Put b into the group"),
    "Python inside": (LOOP, ["c", "p"], r"member 'p' is Python-side and cannot be compiled in\. Leave it out"),
    "member between": (
        LOOP.replace("b.y -> a.u, ", "") + "algorithm: gauss_seidel",
        ["a", "c"],
        r"gauss_seidel b steps after .* before c.* Put b into the group",
    ),
}


@every_case("case", REFUSED)
def test_what_cannot_be_grouped_says_what_to_change(case):
    text, chosen, message = REFUSED[case]
    scenario = parse_scenario(text.replace("ALGORITHM", "jacobi"))
    with pytest.raises(CouplingError, match=message):
        group("g", scenario.cases()[0], resolve_catalogs(scenario)["base"], chosen)


def test_a_whole_loop_may_be_grouped_and_its_parts_know_what_they_hang_on():
    scenario = parse_scenario(LOOP)
    cls = group("g", scenario.cases()[0], resolve_catalogs(scenario)["base"], ["a", "b", "c"])
    assert dependencies(cls) == {"c.y": ()}
    scenario = parse_scenario(SCENARIO.replace("ALGORITHM", "jacobi"))
    cls = group("g", scenario.cases()[0], resolve_catalogs(scenario)["base"], ["sheath", "wall"])
    assert dependencies(cls) == {
        "sheath.reaction_force": ("sheath.gripper_position", "wall.heart_position"),
        "wall.force": ("sheath.gripper_position", "wall.heart_position"),
    }


def test_outputs_of_slow_members_change_when_they_are_published():
    """Also those that no member reads, which are local variables of the group."""
    text = "stop_time: 9 ms\nstep: 1 ms\nmembers: {n: {component: 'tests.coupling.group_parts:Counter'}, a: {component: 'tests.coupling.group_parts:Gain'}}\nconnections: [n.y -> a.u]\n"
    scenario = parse_scenario(text)
    part = group("g", scenario.cases()[0], resolve_catalogs(scenario)["base"], ["n", "a"])()
    part.start(0.0)
    seen = []
    for tick in range(7):
        part.advance(tick * 1e-3, 1e-3)
        seen.append((float(part.views["n.y"]), float(part.views["n.unread"])))
    assert seen == [(0, 0), (0, 0), (1, 1), (1, 1), (1, 1), (2, 2), (2, 2)]


@pytest.mark.slow
def test_fmpy_simulates_a_group_like_the_project_does(tmp_path, build):
    scenario = load_scenario("scenarios/heart_wall_force.yaml")
    case = scenario.cases(["PI+FF+BW"])[0]
    cls = group("control", case, resolve_catalogs(scenario)[case.variant], list(scenario.groups["control"]))
    results = []
    for version in ("2.0", "3.0"):
        path = exporter.export(cls, version, tmp_path / f"{version}.fmu", build)
        assert not fmpy.validation.validate_fmu(str(path))
        results.append(
            fmpy.simulate_fmu(
                str(path), stop_time=0.1, step_size=1e-3, output_interval=1e-3, start_values={"controller.force": 0.1}
            )
        )
    part = cls()
    part.views["controller.force"][...] = 0.1
    part.start()
    own = []
    for k in range(100):
        part.advance(k * 1e-3, 1e-3)
        own.append(float(part.views["controller.target_velocity"]))
    for one in results:
        assert np.array_equal(one["controller.target_velocity"][1:], own)
    assert np.ptp(own) > 0


def test_a_group_also_runs_interpreted():
    scenario = parse_scenario(SCENARIO.replace("ALGORITHM", "jacobi"))
    case = scenario.cases()[0]
    cls = group("g", case, resolve_catalogs(scenario)["base"], ["estimate", "controller"])
    part = cls()
    part.start()
    for k in range(20):
        part.views["controller.force"][...] = 0.1
        assert part.advance(k * 1e-3, 1e-3) == 0
    assert part.views["controller.target_velocity"] > 0.0
    assert part.views["controller.setpoint"] == 0.25


@pytest.mark.slow
def test_a_group_has_event_mode_and_its_members_terminals(tmp_path, build):
    scenario = parse_scenario(SCENARIO.replace("ALGORITHM", "jacobi"))
    case = scenario.cases()[0]
    cls = group("g", case, resolve_catalogs(scenario)["base"], ["estimate", "controller"])
    assert list(cls.terminals) == ["controller.drive"]
    path = exporter.export(cls, "3.0", tmp_path / "g.fmu", build)
    assert validate_fmu(str(path)) == []
    options = {"stop_time": 0.05, "output_interval": 5e-4, "start_values": {"controller.force": 0.1}}
    plain = simulate_fmu(str(path), **options)
    events = simulate_fmu(str(path), use_event_mode=True, early_return_allowed=True, **options)
    last = np.append(np.diff(events["time"]) > 1e-9, True)
    assert np.count_nonzero(~last) == 50
    assert events["controller.target_velocity"][last].tolist() == plain["controller.target_velocity"].tolist()
    assert len(set(plain["controller.target_velocity"])) > 5


def test_terminals_that_are_connected_inside_are_not_carried_over():
    scenario = parse_scenario(SCENARIO.replace("ALGORITHM", "jacobi"))
    case = scenario.cases()[0]
    cls = group("g", case, resolve_catalogs(scenario)["base"], ["heart", "servomotor", "sheath", "wall", "sensor"])
    assert list(cls.terminals) == ["heart.wall"]  # the estimate outside reads it too
    cls = group("g", case, resolve_catalogs(scenario)["base"], ["sheath", "wall"])
    assert list(cls.terminals) == ["sheath.gripper", "wall.heart"]
    members = cls.terminals["sheath.gripper"].members
    assert {key: v.name for key, v in members.items()} == {
        "position": "sheath.gripper_position",
        "force": "sheath.reaction_force",
    }


# ---------------------------------------------------------------------------------- groups of other scenarios as members


RIG = """
stop_time: 0.3 s
members:
  motor:  {component: servomotor, parameters: {mass: 0.7 kg}}
  sheath: {component: sheath}
  sensor: {component: force_sensor}
connections:
  - motor.position -> sheath.gripper_position
  - sheath.reaction_force -> motor.load_force
  - motor.force -> sensor.force
groups: {rig: [motor, sheath, sensor]}
"""
TWO = """
stop_time: 0.3 s
seeds: [1, 2]
members:
  first:  {component: rig.yaml#rig, parameters: {motor.target_velocity: 20 mm/s}}
  second: {component: rig.yaml#rig, parameters: {motor.mass: 2 kg}}
  chirp:  {component: chirp}
connections: [chirp.velocity -> second.motor.target_velocity]
record: ["*.*"]
"""


@pytest.mark.slow
def test_a_group_of_another_scenario_is_a_member(tmp_path, build):
    (tmp_path / "rig.yaml").write_text(RIG)
    scenario = parse_scenario(TWO, tmp_path / "two.yaml")
    runs = [
        run_scenario(
            scenario, RunOptions(root=tmp_path / "runs", build=build, report=form is Backend.fmu, backend=form)
        )
        for form in (Backend.fmu, Backend.compiled, Backend.interpreted)
    ]
    tables = [outcome.tables for outcome in runs]
    values = tables[0]["base", 1].values
    for other in tables[1:]:
        for signal, value in other["base", 1].values.items():
            assert np.asarray(value).tobytes() == np.asarray(values[signal]).tobytes(), signal
    assert values["first.motor.position"][-1] > 5e-3
    assert scenario.cases()[0].values("first", resolve_catalogs(scenario)["base"]["first"])["sensor.seed"] > 0
    noise = [
        np.diff(tables[0]["base", seed].values[f"{name}.sensor.measured_force"])
        for seed in (1, 2)
        for name in ("first", "second")
    ]
    assert all(not np.array_equal(noise[0], one) for one in noise[1:])


@pytest.mark.parametrize(
    ("component", "message"),
    [
        ("rig.yaml#rug", r"two\.yaml:5: member `first`: .*rig\.yaml has no group `rug`\. Did you mean `rig`"),
        ("rag.yaml#rig", r"two\.yaml:5: member `first`: there is no file .*rag\.yaml\. Did you mean `rig\.yaml`"),
        ("rig.yaml#rig@fast", r"two\.yaml:5: member `first`: .*there is no variant `fast`"),
        ("two.yaml#self", r"two\.yaml.* is a part of itself\. Break the circle"),
    ],
)
def test_a_group_that_cannot_be_a_member_says_why(component, message, tmp_path):
    (tmp_path / "rig.yaml").write_text(RIG)
    text = TWO.replace("first:  {component: rig.yaml#rig", f"first:  {{component: {component}")
    text += "groups: {self: [first]}"
    (tmp_path / "two.yaml").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        resolve_catalogs(load_scenario(tmp_path / "two.yaml"))


def test_a_group_needs_only_its_own_variant(tmp_path):
    """A mistake in another variant of its scenario is none of its own; `twin check` of that file finds it."""
    variants = "variants: {good: {}, bad: {members: {motor: {parameters: {mas: 1 kg}}}}}\n"
    (tmp_path / "rig.yaml").write_text(RIG + variants)
    good, bad = (TWO.replace("rig.yaml#rig", f"rig.yaml#rig@{variant}") for variant in ("good", "bad"))
    assert resolve_catalogs(parse_scenario(good, tmp_path / "two.yaml"))["base"]["first"]["motor.mass"].unit == "kg"
    with pytest.raises(
        ScenarioError, match=r"two\.yaml:5: member `first`: .*rig\.yaml:\d+: motor has no variable `mas`"
    ):
        parse_scenario(bad, tmp_path / "two.yaml")


@pytest.mark.slow
def test_a_group_of_groups_gives_the_same_run_to_the_bit(tmp_path, build):
    """Inputs reach the inner group, and what its slow members publish leaves it when it is due."""
    (tmp_path / "rig.yaml").write_text(RIG)
    text = TWO.replace("chirp:  {component: chirp}", "chirp:  {component: chirp}\n  after:  {component: force_sensor}")
    text = text.replace("target_velocity]", "target_velocity, second.sensor.measured_force -> after.force]")
    text = text.replace("[1, 2]", "[1]")
    scenario = parse_scenario(text, tmp_path / "two.yaml")
    case, chosen = scenario.cases()[0], ["second", "chirp", "after"]
    path = tmp_path / "group.fmu"
    exporter.export(group("group", case, resolve_catalogs(scenario)[case.variant], chosen), "3.0", path, build)
    whole = run(text, tmp_path, build)
    alone = {"stop_time": "0.3 s", "seeds": [1], "members": {"group": {"component": str(path)}}, "record": ["*.*"]}
    parted = run(yaml.safe_dump(alone), tmp_path, build)
    signals = ("second.motor.position", "second.sensor.measured_force", "chirp.velocity", "after.measured_force")
    for signal in signals:
        assert np.asarray(parted[f"group.{signal}"]).tobytes() == np.asarray(whole[signal]).tobytes(), signal
    assert np.ptp(whole["second.motor.position"]) > 1e-4
    assert np.ptp(whole["after.measured_force"]) > 1.0
