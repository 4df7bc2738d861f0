"""Scenarios broken on purpose: the tool, its table, and the page that it writes."""

import re

import pytest
import yaml

from benchmarks import mutations
from twin.run import prepare

TABLE = yaml.safe_load(mutations.TABLE.read_text())
CHEAP = ("stepper_calibration", ("overloaded",))


@pytest.mark.parametrize("name", TABLE)
def test_the_last_mutation_of_a_scenario_is_a_scenario(name):
    patch = [*TABLE[name]["central"].values()][-1]
    prepare(mutations.patched(name, mutations.expanded(patch)))


@pytest.mark.parametrize(
    ("patch", "noticed"),
    [
        ({}, []),
        (TABLE["stepper_calibration"]["central"]["a motor that nothing stops"], ["a jam loses steps"]),
        (TABLE["stepper_calibration"]["central"]["no jam"], ["a jam loses steps"]),
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


def test_generic_mutations_break_one_thing_each():
    found = dict(mutations.generic("heart_wall_force"))
    assert found["controller.setpoint: three times"] == {
        "members": {"controller": {"parameters": {"setpoint": "0.6 N"}}}
    }
    way = "sensor.measured_force -> controller.force"
    assert [found[f"{way}: {kind}"]["connections"][0]["to"] for kind in ("other sign", "cut", "50 ms late")] == [
        "controller.force", "controller.force", "late.u",
    ]  # fmt: skip
    assert not any("integral" in label for label in found)  # three times zero is zero
    for label in (f"{way}: other sign", f"{way}: 50 ms late"):
        prepare(mutations.patched("heart_wall_force", found[label]))


def test_the_page_has_every_table_and_nobody_sleeps():
    page = mutations.PAGE.read_text()
    for name, table in TABLE.items():
        rows = re.search(rf"<!-- mutations {name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
        assert rows, f"run: python -m benchmarks.mutations {name}"
        for label in table["central"]:
            (row,) = [line for line in rows[1].splitlines() if line.startswith(f"| {label} |")]
            assert "**nobody**" not in row, f"{name}: {row}"
        assert "Never: " not in rows[1], name
        assert not table.get("seeds") or "nothing fails." in rows[1], name
