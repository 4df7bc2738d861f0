"""Scenarios broken on purpose: the tool, its data, and what scenarios record of it."""

import csv

import pytest
import yaml

from benchmarks import mutations
from twin.cli.describe import show_scenario
from twin.run import resolve_catalogs
from twin.scenario import load_scenario

TABLE = yaml.safe_load(mutations.TABLE.read_text())
LINES = yaml.safe_load(mutations.LINES.read_text())
SAMPLE = ("racs", "regripping", "teleoperation", "stepper_calibration", "bench_buckling")
CHEAP = ("stepper_calibration", ("overloaded",))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", [name for name in TABLE if "central" in TABLE[name]])
def test_the_last_mutation_of_a_scenario_is_a_scenario(name):
    patch = [*TABLE[name]["central"].values()][-1]
    resolve_catalogs(mutations.patched(name, mutations.expanded(patch)))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("patch", "noticed"),
    [
        ({}, []),
        (
            TABLE["stepper_calibration"]["central"]["a motor that nothing stops"],
            ["jam causes lost steps", "lost steps, overloaded"],
        ),
        (TABLE["stepper_calibration"]["central"]["no jam"], ["jam causes lost steps", "lost steps, overloaded"]),
    ],
)
def test_an_expectation_notices_what_breaks_it_and_nothing_else(patch, noticed):
    name, variants = CHEAP
    found = mutations.verdicts(name, patch, variants)
    assert (found.noticed, found.failure, found.refusal) == (noticed, "", "")


def test_a_mutation_that_is_no_scenario_is_refused_not_noticed():
    found = mutations.verdicts("racs", {"members": {"instrument": {"parameters": {"stifness": 1}}}})
    assert "stifness" in found.refusal
    assert not found.noticed


@pytest.fixture
def started(monkeypatch):
    """The variants whose simulations were started."""
    variants = []
    build_simulation = mutations.build_simulation

    def counted(case, *rest):
        variants.append(case.variant)
        return build_simulation(case, *rest)

    monkeypatch.setattr(mutations, "build_simulation", counted)
    return variants


@pytest.mark.slow
def test_what_a_mutation_does_not_change_is_not_run_again(started):
    name, patch = "stepper_calibration", TABLE["stepper_calibration"]["central"]["no jam"]
    sound = mutations.run_sound(name, (), ())
    whole = mutations.verdicts(name, patch)
    started.clear()
    again = mutations.verdicts(name, patch, sound=sound)
    assert started == ["overloaded"]
    assert again == whole


@pytest.mark.slow
def test_a_mutation_ends_with_the_first_variant_that_notices_it(started):
    name, patch = "stepper_calibration", TABLE["stepper_calibration"]["central"]["camera with ten times the noise"]
    sound = mutations.run_sound(name, (), ())
    started.clear()
    found = mutations.verdicts(name, patch, sound=sound, ends_early=True)
    assert found.noticed_beside(sound)
    assert len(started) == 1 < len(sound.cases)
    started.clear()
    unnoticed = mutations.patch_of_line(
        "set slide.load_force 0",
        load_scenario(mutations.SCENARIOS / f"{name}.yaml"),
        resolve_catalogs(mutations.patched(name, {})),
    )
    assert not mutations.verdicts(name, unnoticed, sound=sound, ends_early=True).noticed_beside(sound)
    assert len(started) == sum(sound.cases[key] != case for key, case in cases_of(name, unnoticed).items())


def cases_of(name, patch):
    scenario = mutations.patched(name, patch)
    return {(case.variant, case.seed): case for case in scenario.cases((), scenario.seeds[:1])}


@pytest.mark.slow
def test_a_generic_mutation_is_a_value_that_the_parameter_may_have():
    found = dict(mutations.generic("heart_wall_force"))
    assert "tip.free_length: three times" in found
    assert "tip.free_length: zero" not in found  # at least 1 mm


@pytest.mark.slow
def test_generic_mutations_break_one_thing_each():
    found = dict(mutations.generic("heart_wall_force"))
    assert found["controller.setpoint: three times"] == {
        "members": {"controller": {"parameters": {"setpoint": "0.6 N"}}}
    }
    way = "sensor.measured_force -> controller.force"
    assert [found[f"{way}: {kind}"]["connections"][0]["to"] for kind in ("other sign", "cut", "50 ms late")] == [
        "controller.force",
        "controller.force",
        "late.u",
    ]
    assert not any("integral" in label for label in found)  # three times zero is zero
    for label in (f"{way}: other sign", f"{way}: 50 ms late"):
        resolve_catalogs(mutations.patched("heart_wall_force", found[label]))


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_what_a_scenario_records_of_its_mutations_is_what_there_are(name):
    record = load_scenario(mutations.SCENARIOS / f"{name}.yaml").mutations
    with mutations.SCORES.open(newline="") as file:
        scores = {cells[0]: cells[1] for cells in csv.reader(file)}
    if record is None:
        assert f"`{name}`" not in scores
        return
    known = mutations.mutations_of(name, TABLE.get(name, {}), LINES[name], TABLE.get(name, {}).get("generic", 0))
    assert record.tried == len(known)
    assert set(record.unnoticed) <= set(known)
    assert all(len(reason) > 10 for reason in record.unnoticed.values())
    assert scores[f"`{name}`"] == f"{record.tried - len(record.unnoticed)} of {record.tried}"


@pytest.mark.slow
def test_the_scores_that_are_recorded_come_to_nine_in_ten():
    records = [load_scenario(mutations.SCENARIOS / f"{name}.yaml").mutations for name in LINES]
    tried = sum(record.tried for record in records if record)
    assert tried - sum(len(record.unnoticed) for record in records if record) >= 0.9 * tried


def test_a_description_has_what_is_not_noticed(tmp_path, capsys):
    (tmp_path / "one.yaml").write_text(
        "stop_time: 1 s\nmembers: {heart: {component: heart}}\n"
        "mutations: {tried: 4, unnoticed: {scale heart.rate 2: nothing asks for the rate}}\n"
    )
    (tmp_path / "other.yaml").write_text("extends: one.yaml\n")
    show_scenario(tmp_path / "one.yaml")
    shown = capsys.readouterr().out
    assert "3 of 4 deliberate faults" in shown
    assert "scale heart.rate 2" in shown
    assert "nothing asks for the rate" in shown
    assert load_scenario(tmp_path / "other.yaml").mutations is None


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLE)
def test_a_sample_of_mutations_is_noticed_as_the_scenario_records(name):
    table = TABLE.get(name, {})
    record = load_scenario(mutations.SCENARIOS / f"{name}.yaml").mutations
    chosen = mutations.mutations_of(name, table, LINES[name])
    whole = mutations.verdicts(name, {}, tuple(table.get("variants", ())))
    assert whole.noticed == []
    for label, patch in mutations.every(list(chosen.items()), 6):
        found = mutations.verdicts(name, patch, tuple(table.get("variants", ())))
        assert found.refusal == "", label
        assert bool(found.noticed or found.failure) == (label not in record.unnoticed), label
