"""A finished study, opened from Python."""

import re

import numpy as np
import pytest
from pyarrow import parquet

import twin
from tests.face.parts import SCENARIO
from twin.errors import ScenarioError, TwinError
from twin.face import notebook
from twin.study import load_study, run_study

STUDY = """
title: Gains
scenario: pushed.yaml
variants: [plain, strong]
samples: {method: latin_hypercube, count: 3, seed: 1}
vary:
  part.mass: {uniform: [1000 g, 2000 g], source: assumed}
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
    assert (units["part.mass"], units["reached"], units["seconds"]) == ("g", "mm", "s")  # the mass as in the study file
    stored = parquet.read_table(study.folder / "cases.parquet")  # in the unit of the variable
    np.testing.assert_allclose(study.cases["part.mass"], 1000.0 * np.array(stored["part.mass"]))
    gains = np.where(study.cases.variant == "strong", 5.0, 2.0)
    np.testing.assert_allclose(study.cases.reached, 2000.0 * gains * study.cases.push)


def test_metrics_have_the_units_of_a_run(study, place, build):
    """The smaller unit that the scenario declares for a dimension, as in the report."""
    run = study.case(1, out=place / "units", build=build)
    assert run.metrics.unit.tolist() == [study.cases.attrs["units"]["reached"]] == [study.metrics.unit[0]]


def test_its_answers(study):
    table = study.metrics.set_index("variant")
    own = study.cases[study.cases.variant == "plain"].reached
    assert table.loc["plain", "unit"] == "mm"
    assert table.loc["plain", "mean"] == pytest.approx(own.mean())
    assert table.loc["plain", "deviation"] == pytest.approx(own.std())
    assert table.loc["plain", "50 %"] == pytest.approx(own.median())
    assert table.loc["plain", "worst case"] == study.cases.loc[own.idxmax(), "case"]
    margin = next(name for name in study.cases if name.startswith("margin: "))
    assert study.cases[margin].notna().any()
    rates = study.requirements.set_index("variant")
    assert (rates.loc["plain", "met"], rates.loc["plain", "pass rate"]) == (3, 1.0)
    assert study.answers["cases"] == 6
    assert "100 %" in study._repr_html_()
    assert "<th class=text>requirement</th>" in study._repr_html_()
    assert repr(study) == f"<StudyResult {study.folder}: Gains; completed, 6 cases, 0 did not finish>"


def test_a_case_is_opened_or_run_again(study, place, build):
    """The worst is stored; any other runs again, with the metrics of the study."""
    for number in (study.worst_case("reached"), study.worst_case("reached", "plain"), 1, 2):
        run = study.case(number, out=place / "again", build=build)
        row = study.cases[study.cases.case == number].iloc[0]
        assert run.metrics.value.tolist() == pytest.approx([row.reached])
        assert run.variants == (row.variant,)


def test_the_page_of_a_case_says_which_case_it_is(study):
    """With its factors in words, and a link to the study; not with the options that set them."""
    (number, run) = next(iter(study.manifest["runs"].items()))
    page = study.folder / run / "report.html"
    text, row = page.read_text(), study.cases.set_index("case").loc[int(number)]
    assert f"<h1>Case {number} of Gains, {row.variant}</h1>" in text
    assert re.search(r"part\.mass <b>1\d{3} g</b>, push <b>x \d\.\d+</b></p>", text)
    assert "<p><code>--set" not in text
    link = re.search(r'<a href="([^"]+)">All cases of Gains</a>', text)[1]
    assert (page.parent / link).resolve() == (study.folder / "report.html").resolve()


def test_a_study_is_run_from_python(place, build, monkeypatch):
    """With progress as text; the worst case is a run, and the card has the sentences of the report."""
    (place / "run.yaml").write_text(STUDY.replace("keep: {worst: 1}", "keep: {failed: 1}"))
    limit = "\nexpect:\n  - {name: near, metric: reached, at_most: 10 m, variants: [strong]}\n"
    (place / "limited.yaml").write_text(SCENARIO.partition("\nexpect:")[0] + limit)
    (place / "run.yaml").write_text((place / "run.yaml").read_text().replace("pushed.yaml", "limited.yaml"))
    seen = []
    made = twin.study(
        place / "run.yaml",
        progress=lambda text, part: seen.append((text, part)),
        workers=1,
        out=place / "own",
        build=build,
    )
    assert (made.status, made.folder.parent) == ("completed", place / "own" / "run")
    counts = [text for text, _ in seen if text.startswith("6 of 6 cases")]
    assert counts[0].endswith(f"{(made.cases.reached > 10_000).sum()} fail a requirement")
    assert [fraction for _, fraction in seen] == sorted(fraction for _, fraction in seen)
    assert seen[-1][0].endswith("drawing the plots of the report")
    worst = made.cases.loc[made.cases.reached.idxmax()]
    assert made.worst.metrics.value.tolist() == pytest.approx([worst.reached])
    assert f"case {worst.case}" in made.sentences[0]
    assert notebook.paragraph(made.sentences[0]) in made._repr_html_()
    for wrong in ("rn.yaml", "run.yml"):
        with pytest.raises(ScenarioError, match=r"Did you mean 'run\.yaml'"):
            twin.study(place / wrong)


def test_what_is_not_there(study, place, build, monkeypatch):
    for call, text in (
        (lambda: study.worst_case("reachd"), "Did you mean 'reached'?"),
        (lambda: study.worst_case("reached", "plan"), "Did you mean 'plain'?"),
        (lambda: study.case(9), "has no case 9. The study has cases 1 to 6."),
        (lambda: study.case("x"), "'x' is not the number of a case."),
        (lambda: study.case(1, out=place / "seven", build=build).plot("Places", seeds=7), "seeds 1"),
        (lambda: twin.open_study("gain"), "Did you mean 'gains'?"),
        (lambda: twin.open_study(study.folder.parent), "is a folder of studies. Name one of them"),
    ):
        monkeypatch.chdir(place)
        with pytest.raises(TwinError) as caught:
            call()
        assert text in str(caught.value)
        assert len(caught.value.problems) == 1
    assert twin.open_study("gains").folder.resolve() == study.folder
