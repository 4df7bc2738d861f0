"""The site of all documents is built without a warning: a link that leads nowhere would be one."""

import csv
import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from twin.component import catalog
from twin.scenario import load_scenario, scenario_paths

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def site():
    for package in ("mkdocs", "material", "mkdocstrings", "nbclient", "ipykernel"):
        pytest.importorskip(package, reason="the extra `docs` is not installed")
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "pages.py", "--run", "linear_grip"],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("build/site/index.html\n")
    return ROOT / "build" / "site"


def test_everything_has_a_page(site):
    wanted = [f"components/{name}.html" for name in catalog.names()]
    wanted += [f"scenarios/{name}.html" for name in scenario_paths.scenarios()]
    assert [page for page in wanted if not (site / page).exists()] == []


def test_a_component_shows_its_variables_and_what_it_does(site):
    page = (site / "components" / "servomotor.html").read_text()
    assert "velocity_integral" in page
    assert "at least 0 mm" in page
    assert "<svg" in (site / "components" / "servomotor.svg").read_text()


def test_a_scenario_that_was_run_shows_what_came_out(site):
    page = (site / "scenarios" / "linear_grip.html").read_text()
    assert "What came out" in page
    assert page.count("<td>pass</td>") > 0


def test_what_came_out_is_kept_until_something_changes_that_decides_it(site, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    outcomes = importlib.import_module("outcomes")
    path, whole = ROOT / "scenarios" / "linear_grip.yaml", outcomes.engine()
    assert outcomes.STORE.get("linear_grip", outcomes.key(load_scenario(path), whole))
    assert not outcomes.STORE.get("linear_grip", outcomes.key(load_scenario(path, ["seeds=[1]"]), whole))
    assert not outcomes.STORE.get("linear_grip", outcomes.key(load_scenario(path), "another engine"))


NOTEBOOKS = [  # with their outputs and their pictures
    ("tutorial/python", 10, 1),
    ("tutorial/study", 6, 2),
    ("tutorial/first_component", 4, 0),
    ("how-to/own_controller", 2, 0),
    ("how-to/import_fmus", 3, 0),
    ("how-to/export", 6, 0),
    ("how-to/calibrate", 3, 0),
    ("how-to/identify", 3, 0),
    ("how-to/hardware", 1, 0),
    ("how-to/follow", 2, 0),
]


@pytest.mark.parametrize(("path", "outputs", "pictures"), NOTEBOOKS)
def test_a_notebook_shows_what_its_cells_gave(site, path, outputs, pictures):
    folder, _, name = path.rpartition("/")
    page = (site / f"{path}.html").read_text()
    assert page.count('class="output"') >= outputs
    assert "Traceback" not in page
    assert "\x1b[" not in page
    drawn = re.findall(rf'src="({name}-\d+\.\w+)"', page)
    assert len(drawn) == pictures
    assert all((site / folder / one).stat().st_size > 1000 for one in drawn)
    cells = json.loads((site / f"{path}.ipynb").read_text())["cells"]
    assert all(cell["execution_count"] for cell in cells if cell["cell_type"] == "code")
    assert not any(one["output_type"] == "error" for cell in cells for one in cell.get("outputs", ()))


def test_the_api_is_that_of_the_docstrings(site):
    page = (site / "reference" / "api.html").read_text()
    for name in ("open_run", "CoSimulation", "FMUMember"):
        assert name in page


def test_it_is_searched_without_a_server(site):
    assert "servomotor" in (site / "search" / "search_index.js").read_text()


@pytest.mark.parametrize("page", ["scenario", "hardware_file", "identify", "validation_file", "python"])
def test_a_reference_shows_every_section_of_its_table(page, monkeypatch):
    """On the page, not as a link to a CSV file; several sections have a title each."""
    pytest.importorskip("nbclient", reason="the extra `docs` is not installed")
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    pages = importlib.import_module("pages")
    text = (ROOT / "docs" / "reference" / f"{page}.md").read_text()
    (name,) = {match[3] for match in pages.KEYS.finditer(text)}
    shown = pages.with_keys(text)
    with (ROOT / "docs" / "data" / f"{name}.csv").open(newline="") as file:
        keys = [row[1] for row in csv.reader(file)][1:]
    assert [key for key in keys if f"\n| `{key}` |" not in shown] == []
    assert "Keys: [" not in shown
    assert "Names: [" not in shown
