"""`console:` of a scenario: what a person moves inputs by."""

import pytest

from tests.every_case import every_case
from twin.errors import ScenarioError
from twin.live.worker import endless
from twin.run import resolve_catalogs
from twin.scenario import controls_of, criteria_yaml, parse_scenario, single_case_yaml

HEAD = """
stop_time: 1 s
members:
  command: {component: operator_command, parameters: {live: true}}
  servomotor: {component: servomotor, parameters: {mode_of_operation: 9}}
connections: [command.catheter_velocity -> servomotor.target_velocity]
variants: {one: {}, other: {members: {servomotor: null}}}
console:
"""


def controls(text, variant="one"):
    scenario = parse_scenario(f"{HEAD}{text}")
    catalogs = resolve_catalogs(scenario)
    case = next(one for one in scenario.variants if one.variant == variant)
    return controls_of(scenario, case, catalogs[variant])


def test_units_and_ranges():
    both, upward, pressed = controls(
        '- {input: "command.live_speed[1]", range: 20 mm/s, dead_zone: 8 %, stick: y, keys: [KeyW, KeyS], axis: 1}\n'
        '- {input: "command.live_turn[2]", range: [-10 deg/s, 0.5], rest: 5 deg/s, buttons: 3}\n'
        "- {input: command.pressed, rest: true, label: the switch}\n"
    )
    assert (both.low, both.high, both.rest, both.spec.dead_zone) == (-0.02, 0.02, 0.0, 0.08)
    assert (both.spec.keys, both.spec.label) == (("KeyW", "KeyS"), "command.live_speed[1]")
    assert (upward.low, upward.high) == (pytest.approx(-0.17453, rel=1e-4), 0.5)
    assert upward.rest == pytest.approx(0.087266, rel=1e-4)
    assert (upward.spec.buttons, pressed.low, pressed.high, pressed.rest) == ((3,), 0.0, 1.0, 1.0)


WRONG = {
    "an unknown input": ("command.nothing, range: 1", "command has no variable `nothing`."),
    "an output": ("command.catheter_velocity, range: 1", "command.catheter_velocity is output, not an input."),
    "a parameter": ("servomotor.mass, range: 1", "servomotor.mass is parameter, not an input."),
    "what is connected": ("servomotor.target_velocity, range: 1", "servomotor.target_velocity is connected"),
    "an array": ("command.live_speed, range: 1", "command.live_speed is an array of 2. Name one element,"),
    "no range": ('"command.live_speed[1]"', "command.live_speed[1]: `range` is missing."),
    "another unit": ('"command.live_speed[1]", range: 1 N', "`1 N` does not convert to m/s."),
    "three ends": ('"command.live_speed[1]", range: [1, 2, 3]', "range: expected one value or two"),
    "no way": ('"command.live_speed[1]", range: 0 mm/s', "rest 0 mm/s is not inside 0 mm/s to 0 mm/s."),
    "rest outside": ('"command.live_speed[1]", range: [1, 2]', "rest 0 mm/s is not inside 1000 mm/s to 2000 mm/s."),
    "beyond the input": ("command.live_held, range: 7", "command.live_held: range: -7 is below the minimum."),
    "a range of a bit": ("command.pressed, range: 1", "command.pressed is true or false. Leave `range` out."),
    "along what is none": ("command.pressed, along: {command.held: 1}", "command.held is output, not an input."),
    "along nonsense": ("command.pressed, along: {command.live: 1}", "command.live: expected true or false, not 1."),
    "three keys": (
        "command.pressed, keys: [a, b, c]",
        "console.controls[1].keys: expected at most 2 values, not 3.",
    ),
    "a stick": ("command.pressed, stick: z", "console.controls[1].stick: `z` is not known."),
    "a dead zone": ("command.pressed, dead_zone: 100 %", "console.controls[1].dead_zone"),
    "an unknown key": ("command.pressed, gain: 2", "console.controls[1]: unknown key `gain`."),
    "a variant": ("command.pressed, variants: [three]", "console: there is no variant `three`."),
    "missing elsewhere": ("servomotor.target_position, range: 1, variants: [one, other]", "there is no member"),
}


@every_case("what", WRONG)
def test_says_what_is_wrong(what):
    text, told = WRONG[what]
    with pytest.raises(ScenarioError) as caught:
        controls(f"- {{input: {text}}}")
    (line,) = caught.value.problems
    assert told in line
    assert line.startswith("scenario.yaml:9: ")


def test_a_key_has_one_meaning():
    with pytest.raises(ScenarioError, match=r"key KeyW moves command\.pressed too"):
        controls("- {input: command.pressed, keys: KeyW}\n- {input: command.live, keys: KeyW}\n")
    assert (
        controls(
            "- {input: command.pressed, keys: KeyW, variants: one}\n- {input: command.live, keys: KeyW, variants: other}\n"
        )[0].spec.input
        == "command.pressed"
    )


def test_a_control_without_variants_is_there_where_its_input_is():
    text = "- {input: servomotor.target_position, range: 1 mm}\n- {input: command.pressed}\n"
    assert [one.spec.input for one in controls(text, "one")] == ["servomotor.target_position", "command.pressed"]
    assert [one.spec.input for one in controls(text, "other")] == ["command.pressed"]


def test_one_variant_alone_is_a_scenario_with_the_criteria_that_it_can_meet():
    scenario = parse_scenario(
        HEAD.replace("console:", "") + "metrics: {far: {signal: servomotor.position, reduce: max}}\n"
        "expect: [{metric: far, at_most: 1 mm}, {signal: command.held, at_most: 1, variants: [other]}]\n"
        "groups: {both: [command, servomotor]}\n"
        "plots: [{title: A, signals: [servomotor.position], from: 0.5 s, variants: [one]}]\n"
        "events: [{at: 0.1 s, set: {command.pressed: true}}]\n"
    )
    texts = {case.variant: single_case_yaml(scenario, case, ["command.held"]) for case in scenario.variants}
    criteria = [criteria_yaml(scenario, case, ["servomotor.position"]) for case in scenario.variants]
    assert criteria_yaml(scenario, scenario.variants[0], ["command.held"]) == ""
    one = endless(texts["one"], scenario.variants[0], scenario.path, criteria[0])
    assert (one.variants[0].variant, one.seeds, len(one.plots)) == ("one", (0,), 1)
    assert one.metrics["far"].window.stop_ns == scenario.variants[0].stop_ns
    assert "to:" not in criteria_yaml(scenario, scenario.variants[0], ["servomotor.position"], has_end=False)
    assert [expectation.metric for expectation in one.expectations] == ["far"]
    assert "far" not in texts["one"]  # operated.yaml may end before a window begins
    assert one.plots[0].window.start_ns is None
    assert [event.variable for event in one.variants[0].events] == ["command.pressed"]
    assert one.variants[0].stop_ns == 10**15
    limited = endless(texts["one"], scenario.variants[0], scenario.path, is_limited=True)
    assert limited.variants[0].stop_ns == scenario.variants[0].stop_ns
    other = parse_scenario(f"stop_time: 1 s\n{texts['other']}")
    assert (list(other.variants[0].members), other.plots) == (["command"], ())
    assert other.record.patterns == ("command.held",)


def test_one_variant_alone_has_targets_and_warnings_of_its_members():
    """So that the viewer of a session draws them as the console does."""
    scenario = parse_scenario(
        HEAD.replace("console:", "")
        + "console: {targets: {signal: servomotor.position, tolerance: 1 mm, points: {end: 9 mm}}, "
        "warnings: [{signal: command.held, above: 0, text: held}, {signal: servomotor.current, above: 1 A, text: hot}]}\n"
    )
    alone = {case.variant: single_case_yaml(scenario, case, []) for case in scenario.variants}
    one, other = (parse_scenario(f"stop_time: 1 s\n{alone[name]}") for name in ("one", "other"))
    assert one.console_targets == scenario.console_targets is not None
    assert [each.text for each in one.console_warnings] == ["held", "hot"]
    assert (other.console_targets, [each.text for each in other.console_warnings]) == (None, ["held"])


@every_case(
    ("keys", "title"),
    [
        ("title: Reach\n", "Reach"),
        ("title: Reach\nvariants: {one: {}}\n", "Reach"),
        ("title: Reach\nvariants: {one: {title: Reach}}\n", "Reach"),
        ("title: Reach\nvariants: {one: {title: gently}}\n", "Reach: gently"),
    ],
)
def test_the_title_of_one_variant_alone(keys, title):
    scenario = parse_scenario(f"stop_time: 1 s\nmembers: {{heart: {{component: heart}}}}\n{keys}")
    alone = single_case_yaml(scenario, scenario.variants[0], [])
    assert parse_scenario(f"stop_time: 1 s\n{alone}").title == title


@every_case(
    ("entry", "problem"),
    [
        ("servomotor.nothing: []", "servomotor has no variable `nothing`."),
        ("servomotor.position: []", "servomotor.position is neither a tunable parameter nor a free input."),
        ("servomotor.target_velocity: []", "is neither a tunable parameter nor a free input."),
        ("servomotor.mass: [1 kg]", "expected both ends of its slider"),
        ("servomotor.mass: [2 kg, 1 kg]", "servomotor.mass: the range is empty."),
        ("servomotor.mass: [-1 kg, 1 kg]", "servomotor.mass: range: -1 kg is below the minimum."),
    ],
)
def test_listed_parameters_that_are_wrong(entry, problem):
    head = HEAD.replace("variants: {one: {}, other: {members: {servomotor: null}}}\n", "")
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(f"{head}  parameters: {{{entry}}}\n"))
    assert problem in str(caught.value)
