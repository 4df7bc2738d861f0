"""Take the pictures of docs/how-to/console.md: scenarios that run in the console now, in chromium.

python docs/console.py
"""

from __future__ import annotations

import io
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
COMMAND = "from twin.cli import main; main()"
PATIENCE = 120_000  # FMUs may be built first [ms]
WIDE, NARROW = (1280, 860), (400, 860)
COLORS = 96  # of a picture: a third of the bytes, and no eye sees it
SIMULATED = "hw_bridge/benches/simulated_force.yaml"
MY_BENCH = """title: My bench
simulated: true
cycle: 5 ms
nodes:
  servomotor:
    node: 1
    profile: faulhaber_v3
    limits: {position: [-45 mm, 45 mm], velocity: 200 mm/s, force: 8 N, following_error: 3 mm, acceleration: 3 m/s^2}
    homing: {method: -3, at: -40 mm, speed: 50 mm/s}
"""


@dataclass(frozen=True)
class Shot:
    """A picture: what runs, until when in simulated time [s], how large and how dark the page is."""

    arguments: tuple[str, ...]
    until: float = 3.0
    size: tuple[int, int] = WIDE
    dark: bool = False


SHOTS = {
    "console_rig": Shot(("teleoperation", "--variant", "rehearsed"), until=4.5),
    "console_vessel": Shot(("vessel_teleoperation", "--variant", "rehearsed"), until=7.8),
    "console_bench": Shot(("injection_sequence", "--variant", "normal", "--rate", "10"), until=20.0, dark=True),
    "console_narrow": Shot(("teleoperation", "--variant", "rehearsed"), until=4.5, size=NARROW),
    "console_safety": Shot(("heart_wall_force", "--variant", "PI", "--hardware", SIMULATED), until=2.0),
    "console_commissioning": Shot(("--hardware", "my_bench.yaml")),
}


def running(page: Page, shot: Shot) -> None:
    """A session, some time after its start."""
    page.wait_for_selector(".twin-chart canvas")
    page.wait_for_function("document.querySelector('#twin-how').textContent.startsWith('paused')")
    page.get_by_role("button", name="run").click()
    page.mouse.move(3, shot.size[1] / 2)  # elsewhere a button or a chart tells what is under the pointer
    page.wait_for_function(f"document.querySelector('.twin-chart').chart.lastTime > {shot.until}")


def jogged(page: Page) -> None:
    """The page of commissioning while a button is held."""
    page.wait_for_selector("text=you operate")
    page.get_by_text("commissioned before").click()
    page.get_by_role("button", name="Skip these steps").click()
    page.locator(".q-stepper__tab", has=page.get_by_text("status", exact=True)).first.click()
    page.get_by_role("button", name="status").first.click()
    page.wait_for_selector("text=if this program is lost")
    for step in ("home", "jog"):
        page.locator(".q-stepper__tab", has=page.get_by_text(step, exact=True)).first.click()
    page.get_by_label("speed").first.fill("10 mm/s")
    page.get_by_role("button", name="power on for a jog").first.click()
    page.wait_for_selector(".twin-control")
    page.wait_for_function("!document.querySelector('.twin-control .way').disabled")
    page.locator(".twin-own").click(position={"x": 3, "y": 3})
    page.keyboard.down("ArrowRight")
    page.wait_for_function("document.querySelector('.twin-bench-said').textContent.includes('> ')")
    page.wait_for_timeout(300)


def take(browser: Browser, name: str, shot: Shot, folder: Path) -> None:
    """One picture of a session of its own."""
    command = [sys.executable, "-c", COMMAND, "console", *shot.arguments, "--no-open", "--runs", str(folder)]
    command += ["--build", str(ROOT / "build")]
    alone = shot.arguments[0] == "--hardware"
    if alone:  # the page shows the file's path: a short one
        (folder / "my_bench.yaml").write_text(MY_BENCH)
    process = subprocess.Popen(command, cwd=folder if alone else ROOT, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    scheme = "dark" if shot.dark else "light"
    width, height = shot.size
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    try:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.goto(process.stdout.readline().strip(), wait_until="commit")
        if alone:
            jogged(page)
        else:
            running(page, shot)
        picture = page.screenshot()
    finally:
        context.close()
        process.send_signal(signal.SIGINT)
        process.communicate()
    target = FIGURES / f"{name}.png"
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(COLORS).save(target, optimize=True)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    """All of them, or those that are named."""
    wanted = sys.argv[1:] or list(SHOTS)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"])
        for name in wanted:
            take(browser, name, SHOTS[name], Path(folder))
        browser.close()


if __name__ == "__main__":
    main()
