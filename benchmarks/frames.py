"""Frame times of the pages in chromium: the viewer with ten million samples, and the 3-D view of the console.

    python -m benchmarks.frames           prints `name: value` lines

`open` is from the request of the page to its first drawn curves. Then the mouse zooms by the wheel, moves over the curves with
their read-out, and drags a cursor; in the console it turns the vessel of `vessel_teleoperation` while the session runs. A frame
is the time between two animation frames: 16.7 ms at 60 Hz. `busy` is the processor time of the page's thread in a frame, which
other programs do not lengthen. WebGL is computed by the processor here (SwiftShader).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.viewer import CHROMIUM, COUNT, RATE, SERVER, recorded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).parents[1]
FLAGS = ["--headless", "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader"]
TIMEOUT = 120_000.0  # of a page on a busy machine [ms]
MOVES = 60  # of the mouse, one a frame at 60 Hz
PERIOD = 1 / 60
WINDOW = (1280, 900)
IS_LOADED = """() => { const chart = document.getElementById("chart")?.chart;
    return chart?.frames && !chart.stale && !chart.asking; }"""
RECORD = """() => { const times = window.times = []; const next = (now) => {
    if (window.times !== times) return; times.push(now); requestAnimationFrame(next); }; requestAnimationFrame(next); }"""
TAKE = "() => { const times = window.times; window.times = null; return times; }"
COUNT_RENDERED = """() => { const { picture } = document.querySelector(".twin-space"), render = picture.render.bind(picture);
    window.rendered = 0; picture.render = () => { window.rendered++; render(); }; }"""


@contextmanager
def server(*arguments: str) -> Iterator[str]:
    """Run a command that serves pages; yield its address."""
    process = subprocess.Popen(
        [sys.executable, "-c", SERVER, "twin", *arguments, "--no-open"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.wait()


def show_frames(name: str, page: Any, move: Callable[[float], None]) -> float:
    """Move the mouse by `move`, from 0 to 1; print median, 99 % and longest frame; return the time that it took [s]."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    page.evaluate(RECORD)
    busy = -busy_time(session)
    begin = time.perf_counter()
    for k in range(MOVES):
        move(k / MOVES)
        time.sleep(max(begin + (k + 1) * PERIOD - time.perf_counter(), 0.0))
    busy += busy_time(session)
    frames = np.diff(page.evaluate(TAKE))
    print(f"{name}_frame_ms: {np.median(frames):.1f}, {np.quantile(frames, 0.99):.1f}, {np.max(frames):.1f}")
    print(f"{name}_busy_ms: {1e3 * busy / len(frames):.1f}", flush=True)
    return time.perf_counter() - begin


def busy_time(session: Any) -> float:
    """Return the processor time of the page's main thread [s]."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return float(next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration"))


def measure_viewer(browser: Any, folder: Path) -> None:
    """Open the viewer, zoom and move a cursor."""
    names = ("force", "torque", "position", "current")
    with server("view", str(recorded(folder)), *(f"--signal=sensor.{name}" for name in names)) as address:
        page = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]})
        begin = time.perf_counter()
        page.goto(address, timeout=TIMEOUT)
        page.wait_for_function(IS_LOADED, timeout=TIMEOUT)
        print(f"viewer_open_ms: {1e3 * (time.perf_counter() - begin):.0f}")
        box = page.locator("#chart canvas").bounding_box()
        left, top, width, height = box["x"] + 60, box["y"], box["width"] - 80, box["height"]
        middle = top + height / 2
        page.mouse.move(left + width / 2, middle)
        show_frames("viewer_zoom_in", page, lambda _: page.mouse.wheel(0, -60))
        show_frames("viewer_zoom_out", page, lambda _: page.mouse.wheel(0, 60))
        show_frames("viewer_hover", page, lambda part: page.mouse.move(left + part * width, middle))
        page.mouse.click(left + width / 4, middle)
        cursor = page.evaluate("document.getElementById('chart').chart.cursors[0]")
        page.mouse.move(left + width * cursor * RATE / COUNT, middle)
        page.mouse.down()
        show_frames("viewer_cursor", page, lambda part: page.mouse.move(left + (1 + 2 * part) * width / 4, middle))
        page.mouse.up()
        moved = page.evaluate("document.getElementById('chart').chart.cursors[0]")
        print(f"viewer_cursor_moved_s: {moved - cursor:.0f}")
        page.close()


def measure_space(browser: Any, folder: Path) -> None:
    """Turn the 3-D view while the session runs."""
    words = ("console", "vessel_teleoperation", "--variant", "rehearsed", "--runs", str(folder))
    with server(*words, "--build", str(ROOT / "build")) as address:
        page = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]})
        page.set_default_timeout(TIMEOUT)
        page.goto(address)
        page.get_by_role("button", name="run").click()
        page.locator(".twin-dimensions button", has_text="3-D").click()
        page.wait_for_function("document.querySelector('.twin-space')?.picture?.quarter")
        page.evaluate(COUNT_RENDERED)
        box = page.locator(".twin-space canvas").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        took = show_frames("space_turn", page, lambda part: page.mouse.move(x + 300 * part, y + 80 * part))
        page.mouse.up()
        print(f"space_turn_pictures_per_second: {page.evaluate('window.rendered') / took:.0f}")
        page.close()


def measure() -> None:
    """Print the figures."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        measure_viewer(browser, Path(folder))
        measure_space(browser, Path(folder) / "runs")
        browser.close()
        print(f"load: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    measure()
