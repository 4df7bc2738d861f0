"""Take the pictures of docs/how-to/viewer.md, and that of a report in README.md: runs made now, in chromium.

python docs/viewer.py
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
SERVER = "import sys; sys.argv = sys.argv[1:]; from twin.cli import main; main()"
COLORS = 200  # of a picture, which is half as large then
DRAWN = """() => { const { chart } = document.getElementById("chart");
    return chart && !chart.stale && !chart.asking && chart.panes.flatMap((one) => one.curves).every((one) => chart.data[one.name]); }"""


def item(signal: str, minus: str | None = None) -> dict[str, Any]:
    """A signal of a pane."""
    return {"signal": signal, "minus": minus}


FORCE = {"kind": "time", "items": [item("sensor.measured_force")]}
VIEWS: dict[str, dict[str, Any]] = {
    "viewer_failed": {},  # as it opens
    "viewer_runs": {
        "panes": [
            FORCE,
            {"kind": "time", "items": [item("sheath.tip_position", "A")]},
            {"kind": "spectrum", "items": [item("sensor.measured_force")]},
            {"kind": "xy", "items": [item("sheath.tip_position")], "x": "servomotor.position"},
        ],
        "cases": [3, 6, 12, 15],
        "window": [12, 18],
        "cursors": [13.05, 14.05],
        "offsets": [0, 0],
    },
}


def runs() -> list[Path]:
    """The force experiment as it is, and with a heart that moves more than twice as far: then the force leaves its range."""
    found = []
    for place, overrides in (("runs", ()), ("larger", ("heart.scale=2.2",))):
        scenario = load_scenario(ROOT / "scenarios" / "heart_wall_force.yaml", overrides)
        outcome = run_scenario(scenario, RunOptions(root=Path(place), build=ROOT / "build", report=not overrides))
        found.append(outcome.folder)
    return found


def picture(browser: Browser, address: str, name: str, width: int, scheme: str) -> None:
    """One view as docs/figures/NAME.png."""
    context = browser.new_context(viewport={"width": width, "height": 600}, color_scheme=scheme)  # type: ignore[arg-type]
    page = context.new_page()
    view = VIEWS[name]
    page.goto(f"{address}#{quote(json.dumps(view))}" if view else address)
    page.wait_for_function(DRAWN, timeout=60_000)
    page.wait_for_timeout(500)
    screenshot(page, name, full_page=width > 600)
    context.close()


def report(browser: Browser, folder: Path) -> None:
    """The first screen of a run's report as docs/figures/report.png."""
    page = browser.new_page(viewport={"width": 1000, "height": 900}, color_scheme="light")
    page.goto((folder / "report.html").resolve().as_uri())
    screenshot(page, "report", full_page=False)
    page.close()


def screenshot(page: Page, name: str, full_page: bool) -> None:
    """Save a page as docs/figures/NAME.png."""
    target = FIGURES / f"{name}.png"
    page.screenshot(path=target, full_page=full_page)
    with Image.open(target) as taken:
        taken.convert("RGB").quantize(COLORS).save(target, optimize=True)


def main() -> None:
    """Take all pictures."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as one:
        os.chdir(folder)  # a report shows the path of its folder: a short one
        first, large = runs()
        browser = one.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--headless", "--no-sandbox", "--disable-gpu"]
        )
        report(browser, first)
        for shown, views in {
            (large,): (("viewer_failed", 1280, "light"),),
            (first, large): (("viewer_runs", 1280, "dark"),),
        }.items():
            server = subprocess.Popen(
                [sys.executable, "-c", SERVER, "twin", "view", *map(str, shown), "--no-open"],
                stdout=subprocess.PIPE,
                text=True,
            )
            assert server.stdout is not None
            address = server.stdout.readline().strip()
            for name, width, scheme in views:
                picture(browser, address, name, width, scheme)
            server.terminate()
            server.wait()
        browser.close()


if __name__ == "__main__":
    main()
