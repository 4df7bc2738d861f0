"""A finished study, opened from Python."""

import numpy as np
import pytest

import twin
from twin.errors import TwinError
from twin.study import load_study, run_study

STUDY = """
title: Gains
scenario: pushed.yaml
variants: [plain, strong]
samples: {method: latin_hypercube, count: 3, seed: 1}
vary:
  part.mass: {uniform: [1 kg, 2 kg], source: assumed}
  push: {scales: part.gain, uniform: [0.5, 2], source: assumed}
keep: {worst: 1}
"""


@pytest.fixture(scope="module")
def study(place, build):
    (place / "gains.yaml").write_text(STUDY)
    outcome = run_study(load_study(place / "gains.yaml"), root=place / "runs", build=build, workers=1)
    return twin.open_study(outcome.folder)


def test_its_cases_are_a_table_with_units(study):
    assert len(study.cases) == 6
    units = study.cases.attrs["units"]
    assert (units["part.mass"], units["reached"], units["seconds"]) == ("kg", "mm", "s")
    gains = np.where(study.cases.variant == "strong", 5.0, 2.0)
    np.testing.assert_allclose(study.cases.reached, 2000.0 * gains * study.cases.push)


def test_its_answers(study):
    table = study.metrics.set_index("variant")
    own = study.cases[study.cases.variant == "plain"].reached
    assert table.loc["plain", "unit"] == "mm"
    assert table.loc["plain", "mean"] == pytest.approx(own.mean())
    assert table.loc["plain", "deviation"] == pytest.approx(own.std())
    assert table.loc["plain", "50 %"] == pytest.approx(own.median())
    assert table.loc["plain", "worst case"] == study.cases.loc[own.idxmax(), "case"]
    rates = study.expectations.set_index("variant")
    assert (rates.loc["plain", "met"], rates.loc["plain", "pass rate"]) == (3, 1.0)
    assert study.answers["cases"] == 6
    assert "100 %" in study._repr_html_()
    assert repr(study) == f"<StudyResult {study.folder}: Gains; completed, 6 cases, 0 did not finish>"


def test_a_case_is_opened_or_run_again(study, place, build):
    """The worst is stored; any other runs again, with the metrics of the study."""
    for number in (study.worst_case("reached"), study.worst_case("reached", "plain"), 1, 2):
        run = study.case(number, out=place / "again", build=build)
        row = study.cases[study.cases.case == number].iloc[0]
        assert run.metrics.value.tolist() == pytest.approx([row.reached])
        assert run.variants == (row.variant,)


def test_what_is_not_there(study, place, monkeypatch):
    for call, text in (
        (lambda: study.worst_case("reachd"), "Did you mean 'reached'?"),
        (lambda: study.worst_case("reached", "plan"), "Did you mean 'plain'?"),
        (lambda: study.case(9), "has no case 9. There are 6."),
        (lambda: twin.open_study("gain"), "Did you mean 'gains'?"),
        (lambda: twin.open_study(study.folder.parent), "is a folder of studies. Name one of them"),
    ):
        monkeypatch.chdir(place)
        with pytest.raises(TwinError) as caught:
            call()
        assert text in str(caught.value)
        assert len(caught.value.problems) == 1
    assert twin.open_study("gains").folder.resolve() == study.folder
