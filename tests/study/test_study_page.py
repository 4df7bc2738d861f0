"""The report of a study in a browser: marked rows, Copy buttons, narrow screens."""

import re

import pytest

from tests.study.patients import STUDY, study_file
from tests.web.browser import browser, chromium  # noqa: F401 - fixtures
from twin.study import load_study
from twin.study.answers import page, write_report
from twin.study.execution import manifest
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable
from twin.study.execution.study_runner import StudyOutcome


@pytest.fixture
def report(tmp_path):
    """A study of which every third case fails; its page."""
    study = load_study(study_file(tmp_path, STUDY.replace("count: 6", "count: 12")))
    rows = [
        Row(
            request.number,
            "done",
            "",
            (0.02 + 0.001 * request.number + 0.1 * (request.number % 3 == 0), 0.01),
            (request.number % 3 > 0, None),
        )
        for request in study.requests()
    ]
    outcome = StudyOutcome(study, tmp_path, CaseTable(study, list(study.requests()), rows), "completed", 1234.5)
    manifest.write(tmp_path, command="twin study patients.yaml", engine="3 processes", versions={"numpy": "9"})
    write_report(outcome)
    return tmp_path / page.PAGE


@pytest.mark.slow
def test_a_narrow_screen_scrolls_tables_and_plots_with_legible_letters(browser, report):  # noqa: F811
    shown = browser.new_page(viewport={"width": 360, "height": 800})
    shown.goto(f"file://{report}")
    assert shown.evaluate("document.documentElement.scrollWidth") <= 360
    for section in ("factors", "shares", "clusters", "cases"):  # a block of lines for each row, each with its title
        assert shown.locator(f"#{section} .scroll").first.evaluate("box => box.scrollWidth <= box.clientWidth + 1")
        assert not shown.locator(f"#{section} th").first.is_visible()
    title = "cell => getComputedStyle(cell, '::before').content"
    cells = shown.locator("#cases tbody tr:first-child td")
    assert [cells.nth(k).evaluate(title) for k in (0, 1, 3)] == ['"Case"', '"Verdict"', '"heart.rate /min"']
    plot, wide = (
        shown.locator(f"#pictures details:first-of-type figure{kind}").first for kind in (":not(.wide)", ".wide")
    )
    assert plot.evaluate("box => box.scrollWidth <= box.clientWidth + 1")  # whole
    assert wide.evaluate("box => box.scrollWidth > box.clientWidth")
    for one in (plot, wide):
        letters = one.locator("svg text").evaluate_all("all => all.map(text => text.getBoundingClientRect().height)")
        assert min(letters) >= 9.0
    wide.evaluate("box => { box.scrollLeft = 300; }")
    assert wide.locator("figcaption").bounding_box()["x"] >= 0.0  # the caption stays
    signs = shown.locator("#pictures figure .sideways")
    assert {text for text in signs.all_inner_texts() if text} == {"Wider than the page: scroll sideways →"}
    assert "1234 s" in shown.inner_text(".facts")
    shown.locator("#spreads summary").click()
    assert "that end holds with 97.5 % confidence" in shown.inner_text("#spreads")
    shown.close()


@pytest.mark.slow
def test_a_linked_row_is_marked_and_its_command_copied(browser, report):  # noqa: F811
    context = browser.new_context(
        viewport={"width": 1400, "height": 900}, permissions=["clipboard-read", "clipboard-write"]
    )
    shown = context.new_page()
    shown.goto(f"file://{report}#case-3")
    color = "cell => getComputedStyle(cell).backgroundColor"
    marked, plain = (shown.locator(f"#case-{number} td").first.evaluate(color) for number in (3, 4))
    assert marked != plain
    button = shown.locator("#case-3 button")
    button.click()
    shown.locator("#case-3 button", has_text="Copied").wait_for()  # the clipboard is asynchronous
    assert shown.evaluate("navigator.clipboard.readText()") == f"twin run --case {report.parent}:3"
    assert "not kept" in shown.locator("#case-3 td").first.inner_text()
    facts = shown.locator(".facts div").all_inner_texts()
    assert facts[0].split("\n")[0] == "24"
    assert facts[0].split("\n")[1:] == ["cases: 2 variants of each sample"]
    numbers = [
        int(re.match(r"\d+", text)[0]) for text in shown.locator("#cases tbody td:first-child").all_text_contents()
    ]
    assert numbers[:8] == [3, 6, 9, 12, 15, 18, 21, 24]  # failures first
    rows, more = shown.locator("#cases tbody tr:visible"), shown.locator("#cases .more")
    assert (rows.count(), more.inner_text()) == (20, "Show all 24 rows")  # whole ones, without a box that scrolls
    more.click()
    assert (rows.count(), more.is_visible()) == (24, False)
    assert shown.locator("#cases .scroll").evaluate("box => box.scrollHeight <= box.clientHeight + 1")
    order = shown.locator("header, section").evaluate_all("all => all.map(one => one.id)")
    assert order[:3] == ["", "clusters", "factors"]  # failures directly below the answer
    figure = shown.locator("figure", has=shown.locator("a")).first
    link = figure.locator("a").first
    case = link.get_attribute("xlink:href")[6:]
    link.dispatch_event("click")
    picked = figure.locator(".picked").inner_text()
    cells = shown.locator(f"#case-{case} td.number").all_inner_texts()
    assert picked.startswith(f"Case {case}: force_max ")  # the first plot is of this metric alone
    facts, command = picked.split("\n")[:2]
    assert not re.search(r"^;|\n;|; ;|;$", facts)
    assert command == f"twin run --case {report.parent}:{case}"  # one unbroken line
    assert figure.locator(".picked code").evaluate("code => code.getClientRects().length") == 1
    first = (int(case) - 1) // 2 * 2 + 1  # the sample has a case of each variant
    marked = shown.locator("#pictures a.marked").evaluate_all("all => all.map(a => a.getAttribute('xlink:href'))")
    assert set(marked) == {f"#case-{first}", f"#case-{first + 1}"}
    assert len(marked) == 2 * 2 * (1 + 3 + 1)  # metrics, variants, distribution, scatter plots and parallel axes
    assert f"with case {first + (int(case) == first)} of the same sample" in facts
    assert any(f" {text}" in picked for text in cells)
    assert shown.locator("#cases th").all_inner_texts()[:6] == [
        "Case",
        "Verdict",
        "Variant",
        "heart.rate\n/min",
        "heart.scale",
        "bent end\nx",
    ]
    context.close()
