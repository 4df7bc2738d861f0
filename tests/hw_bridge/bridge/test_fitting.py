"""A hardware file beside a scenario: each mismatch as the line that a user reads, and what takes the members' place."""

from pathlib import Path

import pytest

from hw_bridge.bridge.fitting import connected_inputs, unswitchable
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.hardware import HardwareKeys
from tests.every_case import every_case
from tests.hw_bridge.axis import node
from twin.errors import ScenarioError
from twin.scenario import parse_scenario

SCENARIO = """
stop_time: 1 s
step: 1 ms
members:
  slide: {component: servomotor}
  wall: {component: wall}
  sensor: {component: force_sensor}
  sequencer: {component: "tests.hw_bridge.bridge.output_signals:OutputSignals"}
connections: [slide.position -> wall.tip_position, wall.force -> sensor.force]
"""


def keys(profile="faulhaber_v3", more=None, **slide):
    content = {"simulated": True, "cycle": "5 ms", "nodes": {"slide": node(profile, **slide)}}
    return HardwareKeys.model_validate(content | (more or {}))


def applied(hardware_keys, text=SCENARIO, **options):
    return Hardware(Path("bench.yaml"), hardware_keys, **options).apply(parse_scenario(text, "s.yaml"))


@every_case(
    ("hardware_keys", "changes", "problems"),
    [
        (keys(), {}, []),
        (
            keys(more={"nodes": {"slyde": node()}}),
            {},
            ["bench.yaml: nodes.slyde: no such member. Did you mean 'slide'?"],
        ),
        (
            keys("epos4"),
            {},
            [
                (
                    "bench.yaml: nodes.slide: the motor of maxon EPOS4 turns, the member moves along a line. Add `scale`, "
                    "the member's way for 1 rad of the motor."
                )
            ],
        ),
        (
            keys(),
            {"slide: {component: servomotor": "slide: {component: wall"},
            [
                "bench.yaml: nodes.slide: Wall has no target_velocity, position_actual_value. A drive needs them.",
            ],
        ),
        (
            keys(),
            {"sequencer: {": "other: {component: force_sensor}\n  sequencer: {"},
            [
                (
                    "bench.yaml: nodes.slide: which contact force is to be watched, sensor.measured_force or "
                    "other.measured_force? Add `contact: {signal: sensor.measured_force}`, or `watch_contact: false`."
                )
            ],
        ),
        (keys(watch_contact=False), {"sequencer: {": "other: {component: force_sensor}\n  sequencer: {"}, []),
        (
            keys(contact={"signal": "sensr.measured_force"}),
            {},
            ["bench.yaml: nodes.slide.contact: no member for sensr.measured_force. Correct it."],
        ),
        (
            keys(),
            {"servomotor}": "servomotor, parameters: {mode_of_operation: 7}}"},
            ["s.yaml:5: slide is a drive: mode_of_operation 7: no cyclic mode. Use 8 (csp), 9 (csv) or 10 (cst)."],
        ),
        (
            keys("mclm"),
            {"servomotor}": "servomotor, parameters: {mode_of_operation: 10}}"},
            [
                (
                    "s.yaml:5: slide is a drive: mode_of_operation 10: FAULHABER MCLM 300x CO has no cst. Use 8 (csp) or 9 (csv), "
                    "or a drive that has it."
                )
            ],
        ),
        (
            keys(),
            {"servomotor}": "servomotor, parameters: {drive_period: 0.3 ms}}"},
            ["s.yaml:5: slide is a drive: drive_period 0.3 ms does not divide the drive's control cycle of 1 ms. Use"],
        ),
        (keys(), {"servomotor}": "servomotor, parameters: {drive_period: 0.5 ms}}"}, []),
        (keys(), {"servomotor}": "servomotor, parameters: {drive_period: 3 N}}"}, []),  # reported with the others
        (
            keys(follow={"feedforward": 1.0}),
            {"servomotor}": "servomotor, parameters: {mode_of_operation: 9}}"},
            [
                (
                    "bench.yaml: nodes.slide.follow: feedforward: the member is told speeds, which csv has no offset for. "
                    "Add `mode: csp`, or leave it out."
                )
            ],
        ),
        (
            keys(safe_outputs=0, outputs={0: "sequencer.u", 1: "sequencer.count", 2: "sequencer.pair"}),
            {},
            [
                "bench.yaml: nodes.slide.outputs.0: sequencer.u is an input. Name an output.",
                "bench.yaml: nodes.slide.outputs.1: sequencer.count is Int32, an output needs one Boolean. Name another or an element.",
                "bench.yaml: nodes.slide.outputs.2: sequencer.pair is 2 values, an output needs one Boolean. Name another or an element.",
            ],
        ),
        (keys(safe_outputs=0, outputs={0: "sequencer.on", 1: "sequencer.pair[2]"}), {}, []),
        (
            keys(more={"modules": {"wall": {"node": 9, "safe_outputs": 0, "outputs": {0: "sequencer.off"}}}}),
            {},
            [
                "bench.yaml: modules.wall: the scenario has a member of this name. Use another one.",
                "bench.yaml: modules.wall.outputs.0: ",
            ],
        ),
        (
            keys(),
            {"step: 1 ms": "step: 2 ms"},
            [
                "bench.yaml: cycle: 5 ms is not a multiple of the scenario's step, 2 ms. Change one of them.",
            ],
        ),
    ],
)
def test_what_does_not_fit_is_told_in_its_line(hardware_keys, changes, problems):
    text = SCENARIO
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after)
    if not problems:
        applied(hardware_keys, text)
        return
    with pytest.raises(ScenarioError) as caught:
        applied(hardware_keys, text)
    assert [line[: len(start)] for line, start in zip(caught.value.problems, problems, strict=True)] == problems


def test_signals_that_switch_an_output_are_found_in_members_alone():
    """A member that is an FMU is checked with the other connections."""
    members = dict(parse_scenario(SCENARIO).variants[0].members)
    assert unswitchable("here", {0: "sequencer.on", 1: "fmu.on"}, members) != []
    (line,) = unswitchable("here", {3: "sequencr.on"}, members)
    assert line.startswith("here.3: ")


def test_inputs_that_are_connected():
    assert connected_inputs(parse_scenario(SCENARIO).variants[0]) == {"wall.tip_position", "sensor.force"}


def test_real_drives_need_arm():
    real = HardwareKeys.model_validate({"interface": "socketcan", "channel": "can0", "nodes": {"slide": node()}})
    with pytest.raises(ScenarioError) as caught:
        applied(real)
    assert str(caught.value) == (
        "bench.yaml: socketcan can0 may move real drives. Add --arm if nobody is in their way, or `simulated: true`."
    )
    applied(real, arm=True)


def test_members_are_replaced_by_drives_and_modules():
    """With the variables of the member, its watched force, its outputs; connected to their signals."""
    modules = {"valves": {"node": 9, "safe_outputs": 0, "outputs": {3: "sequencer.pair[1]"}}}
    hardware = Hardware(
        Path("bench.yaml"),
        keys(more={"modules": modules}, safe_outputs=0, outputs={1: "sequencer.on"}),
    )
    text = SCENARIO.replace(
        "servomotor}", "servomotor, isolate: true, communication_step: 2 ms, parameters: {target_force: 1 N}}"
    )
    case = hardware.apply(parse_scenario(text, "s.yaml")).variants[0]
    slide, valves = case.members["slide"], case.members["valves"]
    assert (slide.component, slide.finite, slide.isolate, slide.communication_ns) == (
        "hw_bridge.bridge:slide",
        False,
        False,
        None,
    )
    assert (case.threads, valves.component, valves.where) == (
        1,
        "hw_bridge.bridge:valves",
        "bench.yaml: modules.valves",
    )
    added = [(link.source, link.target, link.where) for link in case.connections][2:]
    assert added == [
        ("sensor.measured_force", "slide.contact_force", "bench.yaml: nodes.slide"),
        ("sequencer.on", "slide.output_1", "bench.yaml: nodes.slide.outputs.1"),
        ("sequencer.pair[1]", "valves.output_3", "bench.yaml: modules.valves.outputs.3"),
    ]
    names = {variable.name: variable.role.name for variable in slide.made.variables}
    assert {
        name: names[name] for name in ("contact_force", "output_1", "actual_value_age", "position", "load_force")
    } == {
        "contact_force": "input",
        "output_1": "input",
        "actual_value_age": "output",
        "position": "output",
        "load_force": "input",
    }
    assert [variable.name for variable in valves.made.variables] == ["output_3"]
    assert (slide.made.forced, slide.made.variant, slide.made.__name__) == (True, "base", "Drive_slide")
    assert hardware.rotary == {"slide": False}
    without = applied(keys(watch_contact=False)).variants[0].members["slide"].made
    assert "contact_force" not in {variable.name for variable in without.variables}
    assert not without.forced


def test_the_trace_of_each_case_has_a_name_of_its_own():
    hardware = Hardware(Path("bench.yaml"), keys(), trace=Path("a/x.blf"))
    names = []
    for _ in range(3):
        names.append(str(hardware._trace()))
        hardware.sessions.append(None)
    assert names == ["a/x.blf", "a/x-2.blf", "a/x-3.blf"]
    assert Hardware(Path("bench.yaml"), keys())._trace() is None
