"""Figures in README and docs: generated ones are there, quoted ones are those of the table that they come from."""

import csv
import importlib
import re
import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml

from tests.every_case import every_case

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"<!-- ([a-z]+ \w+) -->(.*?)<!-- end -->", re.DOTALL)
ENTRIES = yaml.safe_load((ROOT / "docs" / "what_if.yaml").read_text())
QUOTED = yaml.safe_load((ROOT / "docs" / "quoted.yaml").read_text())


def blocks(page):
    return dict(BLOCK.findall(page.read_text()))


def key(name):
    return f"{'results' if 'columns' in ENTRIES[name] else 'figure'} {name}"


@every_case("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_is_generated_is_there(page):
    text = page.read_text()
    assert len(re.findall(r"<!-- (?:results|figure) ", text)) == sum(
        name.startswith(("results", "figure")) for name, _ in BLOCK.findall(text)
    ), "a comment has no end, or two have the same name"
    for name, content in blocks(page).items():
        assert content.strip(), f"{name}: run the program of docs/ that writes it"


def test_each_entry_has_its_place_and_each_place_its_entry():
    named = {key(name): entry["page"] for name, entry in ENTRIES.items() if "page" in entry}
    for name, page in named.items():
        assert name in blocks(ROOT / page), f"{page} has no comment `{name}`"
    for page in PAGES:
        for name in blocks(page):
            if name.startswith("figure "):
                assert named.get(name) == str(page.relative_to(ROOT)), name


def sentences(page):
    return " ".join(BLOCK.sub("", (ROOT / page).read_text()).split())


@pytest.mark.parametrize("entry", [one for one in QUOTED if "values" in one], ids=lambda entry: entry["page"])
def test_what_a_page_quotes_is_what_a_file_of_results_has(entry):
    lines = (line.split(": ", 1) for line in (ROOT / entry["from"]).read_text().splitlines())
    results = {name: [float(value) for value in text.split(", ")] for name, text in lines if name in entry["values"]}
    assert results.keys() == entry["values"].keys()
    for name, text in entry["values"].items():
        assert text in sentences(entry["page"]), text
        numbers = re.findall(r"\d+(?:\.(\d+))?", text)
        written = [float(one) for one in re.findall(r"\d+(?:\.\d+)?", text)]
        part = 100.0 if "%" in text else 1.0
        assert len(written) == len(results[name])
        for number, decimals, value in zip(written, numbers, results[name], strict=True):
            assert abs(part * value - number) <= 0.500001 * 10.0 ** -len(decimals), f"{name}: {value}, not {number}"


@every_case(
    "entry",
    [one for one in QUOTED if "figures" in one],
    ids=lambda entry: f"{entry['page']}: {entry.get('table', entry['from'])}",
)
def test_what_a_sentence_quotes_stands_in_the_table(entry):
    table = blocks(ROOT / entry["from"])[entry["table"]] if "table" in entry else (ROOT / entry["from"]).read_text()
    for figure in entry["figures"]:
        assert figure in table, f"{figure} is not in the table (any more)"
        assert figure in sentences(entry["page"]), f"{entry['page']} does not say {figure} (any more)"


def test_counts_of_public_fmus_and_systems_are_those_of_their_tables():
    page, counts = sentences("docs/how-to/import_fmus.md"), {}
    for name in ("fmus", "systems"):
        with (ROOT / "docs" / "data" / f"public_{name}.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        counts[name] = Counter((row["ours"] == "runs", row["FMPy"] == "runs") for row in rows)
        assert f"[{len(rows)} " in page
    fmus, systems = counts["fmus"], counts["systems"]
    assert f"FMPy and this project run {fmus[True, True]}, this project alone {fmus[True, False]} " in page
    assert f"FMPy alone {fmus[False, True]}." in page
    ours = systems[True, True] + systems[True, False]
    assert f"{ours} run, {systems[True, True]} of which by FMPy or libcosim too; {systems[False, True]} run by" in page


def test_each_complete_table_is_linked_from_a_page():
    named = {name for page in PAGES for name in re.findall(r"\]\(\.\./data/(\w+\.csv)\)", page.read_text())}
    assert {path.name for path in (ROOT / "docs" / "data").glob("*.csv")} == named


@every_case("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_rows_of_a_page_are_those_of_its_complete_table(page):
    tables, complete = load("tables"), []
    for name in re.findall(r"\]\(\.\./data/(\w+)\.csv\)", page.read_text()):
        with (ROOT / "docs" / "data" / f"{name}.csv").open(newline="") as file:
            complete.append(list(csv.reader(file)))
    for mark, content in blocks(page).items():
        if content.strip().startswith("|"):
            head, *rows = tables.cells(content.strip())
            sources = [
                table for table in complete if set(head) <= set(table[0]) and len(set(table[0])) == len(table[0])
            ]
            selected = [[[row[table[0].index(column)] for column in head] for row in table[1:]] for table in sources]
            assert not sources or any(all(row in table for row in rows) for table in selected), mark


def load(name="what_if"):
    """Import a module of docs/."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(ROOT / "docs"))


def test_least_and_largest_are_written_in_the_unit():
    what_if = load()
    assert what_if.span([0.0121, 0.0118, 0.012], {"unit": "mN", "digits": ".1f"}) == "11.8 to 12.1 mN"
    assert what_if.span([0.0121, 0.01209], {"unit": "mN", "digits": ".0f"}) == "12 mN"
    assert what_if.span([2.0], {"digits": ".1f"}) == "2.0"


def test_changes_lie_over_each_other():
    merged = load().merged
    assert merged({"a": {"b": 1, "c": 2}}, {"a": {"b": 3}, "d": None}) == {"a": {"b": 3, "c": 2}, "d": None}


@pytest.mark.slow
@pytest.mark.parametrize("name", ENTRIES)
def test_a_generated_figure_is_what_comes_out_now(name):
    what_if = load()
    entry = ENTRIES[name]
    found = what_if.table(entry) if "columns" in entry else what_if.shown(entry, [entry["variant"]])
    if "page" in entry:
        assert blocks(ROOT / entry["page"])[key(name)].strip() == found, "run `python docs/what_if.py`"
    else:
        with (ROOT / "docs" / "data" / f"{name}.csv").open(newline="") as file:
            assert list(csv.reader(file)) == load("tables").cells(found), "run `python docs/what_if.py`"
