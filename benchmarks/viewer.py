"""What looking at ten million samples costs, as `twin view` does it: opening, the first look, every zoom after it.

    python -m benchmarks.viewer           prints `name: value` lines

Samples are those of a force at 10 kHz for 1000 s, in a folder of its own. A zoom is what the server answers: 2000 points of
four curves, of the whole recording or of a part of it, the mean over places; `page` is the same in chromium, from the
request to the drawn canvas, if it is there.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.face import open_run
from twin.results.recording.run_folder import RecordedVariable, SignalFile
from twin.results.recording.signals import Signals
from twin.viewer import RunCollection, ViewedCurve
from twin.viewer.curve_data import KINDS
from twin.viewer.requests import lines

if TYPE_CHECKING:
    from collections.abc import Callable

COUNT, RATE = 10_000_000, 10_000.0
POINTS = 2000
PARTS = (1.0, 0.1, 0.01, 0.001)
PLACES = 20
SERVER = "import sys; sys.argv = sys.argv[1:]; from twin.cli import main; main()"
CHROMIUM = shutil.which("chromium")
ZOOM = """async ([from, to]) => { const { chart } = document.getElementById("chart"), begin = performance.now();
    chart.zoom(from, to); const frames = chart.frames;
    while (chart.frames === frames || chart.stale || chart.asking) await new Promise(requestAnimationFrame);
    return performance.now() - begin; }"""


def recorded(folder: Path) -> Path:
    """The folder of a run with four signals."""
    rng = np.random.default_rng(1)
    names = [f"sensor.{name}" for name in ("force", "torque", "position", "current")]
    time_, part = np.arange(COUNT) / RATE, 1 << 20
    with SignalFile(folder / "signals.parquet", [RecordedVariable(name, unit="N") for name in names], {}) as file:
        for begin in range(0, COUNT, part):
            own = time_[begin : begin + part]
            values = {
                name: np.sin(2 * np.pi * (1.2 + i) * own) + 0.02 * rng.standard_normal(len(own))
                for i, name in enumerate(names)
            }
            file.write("base", 1, Signals(own, values, dict.fromkeys(names, "N")))
    about = {"name": "long", "title": "Ten million samples", "description": "", "source": "", "path": ""}
    case = {"variant": "base", "seed": 1, "complete": True, "samples": COUNT}
    told = {"scenario": about, "status": "completed", "overrides": [], "cases": [case], "expectations": []}
    (folder / "summary.json").write_text(json.dumps(told | {"started": "2026-11-22T21:00:00+00:00", "metrics": {}}))
    (folder / "scenario.yaml").write_text("title: long\nstop_time: 1000 s\nstep: 1 ms\nmembers: {}\n")
    return folder


def taken(work: Callable[[], Any]) -> float:
    """Milliseconds of wall time."""
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)


def windows(part: float) -> list[list[float]]:
    """Where to look: all over the recording."""
    end = COUNT / RATE
    places = np.linspace(0.0, end * (1 - part), PLACES if part < 1 else 3)
    return [[float(one), float(one + part * end)] for one in places]


def measure() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as place:
        folder = recorded(Path(place))
        opened: list[RunCollection] = []
        print(f"viewer_open_ms: {taken(lambda: opened.append(RunCollection([open_run(folder)]))):.1f}")
        (runs,) = opened
        names = list(runs.runs[0].variables)

        def look(window: list[float]) -> bytes:
            curves = [{"signal": name, "case": 0, "window": window} for name in names]
            return lines({"points": POINTS, "curves": curves}, runs)

        print(f"viewer_first_look_ms: {taken(lambda: look(windows(1.0)[0])):.0f}")
        for part in PARTS:
            print(f"viewer_zoom_{part:g}_ms: {np.mean([taken(partial(look, one)) for one in windows(part)]):.2f}")
        for name, kind, signal in (
            ("expression", "time", "abs(sensor.force - sensor.torque)"),
            ("spectrum", "spectrum", "sensor.force"),
        ):
            draw = partial(KINDS[kind], runs, ViewedCurve(signal, 0), (0.0, COUNT / RATE), POINTS)
            print(f"viewer_{name}_first_ms: {taken(draw):.0f}")
            print(f"viewer_{name}_ms: {min(taken(draw) for _ in range(3)):.0f}")
        print(f"viewer_memory_MB: {runs.cache.size / 1e6:.0f}")
        if CHROMIUM:
            in_page(folder, names)


def in_page(folder: Path, names: list[str]) -> None:
    """The same from the hand to the eye."""
    from playwright.sync_api import sync_playwright

    words = ["twin", "view", str(folder), "--no-open", *(f"--signal={name}" for name in names)]
    server = subprocess.Popen([sys.executable, "-c", SERVER, *words], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        with sync_playwright() as one:
            browser = one.chromium.launch(
                executable_path=CHROMIUM, args=["--headless", "--no-sandbox", "--disable-gpu"]
            )
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(server.stdout.readline().strip())
            page.evaluate(ZOOM, windows(1.0)[0])
            for part in PARTS:
                found = [page.evaluate(ZOOM, window) for window in windows(part)]
                print(f"viewer_page_{part:g}_ms: {np.mean(found):.0f}")
            browser.close()
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    measure()
