"""What a console costs the loop that it shows: jitter with its page open beside closed, in one session.

    python -m benchmarks.console [SECONDS]     prints `name: value` lines; 12 s for each part if nothing is said

A session of `teleoperation` in simulated time, paced at rate 1, and the whole rig on three drives in processes of their own
over udp_multicast, at a cycle of 5 ms. Closed: the server runs, nobody looks. Open: Chromium has the page, which draws its
charts, and fetches eight signals thirty times a second beside. Parts alternate; jitter is 99 of 100, of the blocks' beginnings
or of the periods between SYNCs, the median over the parts. A machine with few cores shares them with Chromium itself: `reader`
is the same with the eight signals read in the server's process alone.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import hil
from twin import web
from twin.console import Host, register

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build"
SCENARIO = ROOT / "scenarios" / "teleoperation.yaml"
CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
PARTS = 3  # of each kind
SECONDS = 12.0  # the loop tells of its last ten
FRAME = 1.0 / 30.0
DRAWN = "document.querySelector('.twin-chart')?.chart.frames ?? 0"  # frames of the page's chart
PATIENCE = 120_000.0  # of a browser on a busy machine [ms]
SIGNALS = (
    "instrument.tip_position",
    "instrument.tip_velocity",
    "servomotor_1.position",
    "servomotor_2.position",
    "command.catheter_velocity",
    "instrument.gripper_force[1]",
    "instrument.gripper_force[2]",
    "rotation.position_actual_value",
)
ASKS = """(names) => { window.count = 0; setInterval(async () => {
    const query = names.map(one => 'name=' + encodeURIComponent(one)).join('&');
    const answer = await fetch('/data?' + query + '&span=10&points=800'); await answer.arrayBuffer(); window.count += answer.ok;
}, 1000 / 30); }"""


@contextmanager
def served(console: Host) -> Iterator[str]:
    """The address of a console whose server runs in a thread of this process."""
    said: list[str] = []
    site = web.Site("benchmark", lambda app: register(app, console), announce=said.append, open_browser=False)
    threading.Thread(target=site.serve, daemon=True).start()
    until(lambda: bool(said), 30.0)
    yield said[0]


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser, without a page; None where there is none."""
    if not CHROMIUM.exists():
        yield None
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as player:
        browser = player.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS, timeout=PATIENCE)
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def page(browser: Any, address: str, told: dict[str, float]) -> Iterator[None]:
    """The page in the browser, which fetches the signals."""
    one = browser.new_page()
    try:
        one.goto(address, timeout=PATIENCE)
        one.evaluate(ASKS, list(SIGNALS))
        begin, drawn = time.monotonic(), one.evaluate(DRAWN)
        yield
        took = time.monotonic() - begin
        told["frames"], told["drawn"] = one.evaluate("window.count") / took, (one.evaluate(DRAWN) - drawn) / took
    finally:
        one.close()


@contextmanager
def reader(console: Host, told: dict[str, float]) -> Iterator[None]:
    """The same signals read in this process, by a thread."""
    end, count = threading.Event(), 0

    def read() -> None:
        nonlocal count
        while not end.wait(FRAME):
            assert console.source is not None
            _, last = console.source.span()
            for name in SIGNALS:
                console.source.read(name, last - 10.0, last, 800)
            count += 1

    thread = threading.Thread(target=read)
    thread.start()
    begin = time.monotonic()
    yield
    end.set()
    thread.join()
    told["reads"] = count / (time.monotonic() - begin)


@contextmanager
def closed() -> Iterator[None]:
    """Nobody looks."""
    yield


def until(condition: Callable[[], object], seconds: float) -> None:
    """Wait for it."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError
        time.sleep(0.01)


def jitter(console: Host) -> float:
    """Of the last ten seconds [s]."""
    live = console.live
    assert live is not None
    if live.catalog is not None and live.catalog.wall_clock:
        assert live.state.hardware is not None
        return float(live.state.hardware["jitter_99"])
    return live.state.jitter


def measure(name: str, console: Host, address: str, browser: Any, seconds: float) -> None:
    """One session: alternate, and print the medians and their ratios."""
    console.begin(SCENARIO)
    live, told = console.live, dict[str, float]()
    assert live is not None
    live.wait()
    live.resume()
    until(lambda: live.state.time > 0.5, 60.0)
    kinds: dict[str, Callable[[], Any]] = {"closed": closed, "reader": lambda: reader(console, told)}
    if browser is not None:
        kinds["open"] = lambda: page(browser, address, told)
    found: dict[str, list[float]] = {kind: [] for kind in kinds}
    for _ in range(PARTS):
        for kind, begun in kinds.items():
            with begun():
                time.sleep(seconds)
                found[kind].append(jitter(console))
    for kind, values in found.items():
        print(f"{name}_{kind}_jitter_99_ms: {1e3 * median(values):.3f}")
    for kind in list(found)[1:]:
        print(f"{name}_{kind}_ratio: {median(found[kind]) / max(median(found['closed']), 1e-9):.2f}")
    for kind, value in told.items():
        print(f"{name}_{kind}_per_second: {value:.1f}")
    print(f"{name}_achieved_rate: {live.state.achieved:.3f}")
    print(f"{name}_load: {os.getloadavg()[0]:.1f}", flush=True)
    console.close()


def main(seconds: float) -> None:
    """Both kinds of loops."""
    with tempfile.TemporaryDirectory() as folder:
        console = Host(runs=Path(folder), build=BUILD)
        with served(console) as address, chromium() as browser:
            measure("simulated", console, address, browser, seconds)
            console.hardware = hil.rig_bench(Path(folder), "udp_multicast", hil.GROUP)
            with hil.drives(hil.RIG_DRIVES, "udp_multicast", [hil.GROUP] * len(hil.RIG_DRIVES), BUILD):
                measure("hardware", console, address, browser, seconds)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
