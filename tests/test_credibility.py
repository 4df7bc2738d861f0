"""The page on credibility: its tables are those of its command, and its fast ones come out as printed."""

import csv
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from twin.scenario import load_scenario

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"


@pytest.fixture(scope="module")
def docs():
    """The command's modules."""
    sys.path.insert(0, str(ROOT / "docs"))
    spec = importlib.util.spec_from_file_location("credibility", ROOT / "docs" / "credibility.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(ROOT / "docs"))
    return module


def rows(name):
    """Rows of a complete table of the page, its head first."""
    with (DATA / f"{name}.csv").open(newline="") as file:
        return list(csv.reader(file))


@pytest.mark.slow
def test_orders_are_those_that_are_printed(docs):
    assert docs.cells(docs.orders()) == rows("convergence_orders")


@pytest.mark.slow
def test_energy_goes_in_is_kept_and_becomes_heat(docs):
    work, heat, kept = docs.balanced(0.2e-3, 0.3)
    assert work == pytest.approx(heat + kept, rel=0.01)
    assert min(heat, kept) > 0.01 * work


@pytest.mark.slow
def test_every_published_row_has_its_kind_and_stands_on_the_page(docs):
    printed = [row[0] for row in rows("validation")]
    for name in docs.ROWS:
        metrics = load_scenario(ROOT / "scenarios" / f"{name}.yaml").metrics
        for metric, begin, _, _ in docs.ROWS[name]:
            assert metric in metrics, (name, metric)
            assert any(one.startswith(begin) for one in metrics[metric].paper), (name, metric, begin)
            assert any(label.startswith(f"{name}, {metric}, {begin}") for label in printed), (name, metric, begin)


def test_the_paper_s_force_rows_are_the_scenario_s(docs):
    metrics = load_scenario(ROOT / "scenarios" / "heart_wall_replay.yaml").metrics
    for variant, values in docs.PAPER.items():
        told = [1e3 * metrics[name].paper[variant] for name in docs.METRICS]
        assert list(values) == pytest.approx(told), variant


@pytest.mark.slow
def test_the_nominal_plant_gives_the_first_step_s_row(docs):
    uncertainty = docs.uncertainty
    named = {row[0] for row in rows("sensitivity")[1:-1]}
    assert named == set(uncertainty.NAMES)
    members = uncertainty.parameters(uncertainty.nominal())
    assert members["sheath"]["parameters"]["play"] == ["0 m", "0.0003 m", "0.0003 m"]
    found = uncertainty.figures({"members": members})
    printed = {row[0]: row[1] for row in rows("communication_steps")}
    for k, variant in enumerate(docs.VARIANTS):
        assert printed[f"force_error_std, {variant}"] == f"{found[k, 0]:.2f} mN"


def test_parts_of_the_variance_are_found_where_they_are_known(docs):
    points = np.random.default_rng(0).random((500, 3))
    found, explained = docs.uncertainty.first_order(points, 3.0 * points[:, 0] + points[:, 1])
    assert found == pytest.approx([0.9, 0.1, 0.0], abs=0.07)
    assert explained > 0.95
