"""Pages of the viewer in a browser, for the tests of what a person does there."""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from time import monotonic
from urllib.parse import unquote

from tests.viewer.recorded import runs
from twin.viewer.runs import ViewedCurve


@contextmanager
def viewed(*words):
    """Where `twin view` says that it is; at the end Ctrl-C is answered with a sentence."""
    words = ["twin", "view", *map(str, words), "--no-open"]
    server = subprocess.Popen(
        [sys.executable, "-c", "import sys; sys.argv = sys.argv[1:]; from twin.cli import main; main()", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield server.stdout.readline().strip()
    finally:
        server.send_signal(signal.SIGINT)
        out, err = server.communicate(timeout=20)
    assert (out, err, server.returncode) == ("The viewer is closed.\n", "", 0)


class Page:
    """A page with what it asked for, and what went wrong in it."""

    def __init__(self, context, address):
        self.asked, self.wrong = [], []
        context.set_default_timeout(60_000)  # where many tests share few cores
        self.page = context.new_page()
        self.page.on("request", lambda one: self.asked.append(one.url))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        self.page.goto(address)
        self.drawn()

    def until(self, condition):
        """Wait for a condition; a file's security policy lets a browser evaluate it once, not again and again by itself."""
        end = monotonic() + 60.0
        while not self.page.evaluate(condition):
            assert monotonic() < end, condition
            self.page.wait_for_timeout(20)

    def drawn(self):
        """Wait until nothing is asked any more and all curves are there."""
        self.until("""() => { const { chart } = document.getElementById("chart");
            return chart && !chart.stale && !chart.asking && chart.panes.flatMap((one) => one.curves).every((one) => chart.data[one.name]); }""")

    @property
    def state(self):
        """What the address keeps; it is written a moment later."""
        self.until("""() => { const { chart } = document.getElementById("chart"), own = (one) => JSON.stringify(one);
            try { const kept = JSON.parse(decodeURIComponent(location.hash.slice(1)));
                  return own(kept.window) === own(chart.window) && own(kept.cursors) === own(chart.cursors); } catch { return false; } }""")
        return json.loads(unquote(self.page.url.partition("#")[2]))

    def place(self, part, pane=0):
        """Where a part of the time axis is on the screen."""
        return self.page.evaluate(
            """([part, pane]) => { const { chart, canvas = chart.canvas } = document.getElementById("chart"), box = chart.boxes[pane];
            const { left, top } = canvas.getBoundingClientRect(), [from, to] = chart.axis();
            return [left + box.across(from + part * (to - from)), top + box.top + box.height / 2]; }""",
            [part, pane],
        )

    def drag(self, begin, end):
        """Drag over the first pane."""
        mouse = self.page.mouse
        mouse.move(*self.place(begin))
        mouse.down()
        mouse.move(*self.place(end), steps=3)
        mouse.up()
        self.drawn()

    def curves(self):
        """Title, unit and points of every pane."""
        self.page.wait_for_timeout(60)
        self.drawn()
        return self.page.evaluate("""() => { const { chart } = document.getElementById("chart");
            return chart.panes.map(({ title, unit, curves, spans, limits }) => ({ title, unit, spans, limits,
              curves: curves.map(({ name, label }) => ({ label, x: [...chart.data[name].x], y: [...chart.data[name].y] })) })); }""")


def table(page, wanted):
    """The rows of the table of values, once its heading has some columns."""
    page.page.wait_for_function(
        "wanted => { const head = document.querySelector('#values tr')?.innerText ?? ''; return wanted.every((one) => head.includes(one)); }",
        arg=wanted,
    )
    rows = page.page.locator("#values tr")
    return [rows.nth(k).locator("th, td").all_inner_texts() for k in range(rows.count())]


def numbers(texts):
    """The numbers that cells begin with."""
    return [float(text.split()[0]) for text in texts]


def samples_of(folders, number, signal="heart.position"):
    """Times and shown values of a case of A and B."""
    own = runs(*folders).samples(ViewedCurve(signal, number))
    return own.time, own.shown(own.y)
