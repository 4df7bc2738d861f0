"""The page of a followed rig in a browser: bands, forecast, changes, and the message that the twin does not represent it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.follow.test_linear import TEXT, estimate
from tests.viewer.pages import Page, viewed
from tests.viewer.test_following import CHANGE, LOST, followed
from twin.follow import EstimateRecording, load
from twin.follow.changes import Alarm
from twin.follow.forecast import Forecast

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (1400, True), (900, False), (360, False)])
def test_a_followed_rig(tmp_path, browser, width, dark):
    with viewed(followed(tmp_path / "run", LOST | CHANGE)) as address:
        context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light"
        )
        page = Page(context, address)
        lost = page.page.locator("#lost")
        assert lost.is_visible()
        assert lost.inner_text() == f"The twin no longer represents the rig. {LOST['reason']} Since 4.2 s."
        panes = page.curves()
        assert [pane["title"] for pane in panes][:3] == ["arm.tip", "arm.tip: forecast", "arm.play"]
        assert [curve["label"] for curve in panes[0]["curves"]] == [
            "measured",
            "predicted, 95 % band",
            "forecast, 25 % leave -10 to 10 mm",
        ]
        assert panes[0]["curves"][2]["x"] == [10.4, 10.9]
        assert panes[0]["curves"][2]["y"] == pytest.approx([1.0, 2.0])
        bands = page.page.evaluate("""() => { const { chart } = document.getElementById("chart");
            return chart.panes.map(({ curves }) => curves.map(({ low, high }) => [low, high].map((name) => name && [...chart.data[name].y].slice(-1)[0]))); }""")
        assert bands[0][2] == [0.0, 4.0]
        assert bands[2][0] == pytest.approx([2000.0 - 392.0, 2000.0 + 392.0])
        assert bands[3][0] == pytest.approx([0.001, 5.0], rel=1e-6)
        box = page.page.locator("#following")
        assert box.locator("summary").inner_text() == "Following: does not represent the rig, 1 change"
        assert "wear of the arm since 4.0 s, noticed at 5.0 s with 99.0 %" in box.inner_text()
        assert page.page.evaluate("document.documentElement.scrollWidth") <= width
        box.get_by_role("button").click()
        page.drawn()
        low, high = page.state["window"]
        assert (low + high) / 2 == pytest.approx(4.0)
        assert page.wrong == []
        context.close()


def test_a_rig_while_it_is_followed(tmp_path, browser):
    (tmp_path / "data.csv").write_text("time [s],position [mm]\n0,0\n0.1,1\n0.2,2\n")
    (tmp_path / "mass.yaml").write_text(TEXT)
    problem = load(tmp_path / "mass.yaml")
    recording = EstimateRecording(problem, tmp_path)
    times = 0.05 * np.arange(1, 300)
    recording.write([estimate(float(time)) for time in times[:200]])
    with viewed(recording.folder) as address:
        page = Page(browser.new_context(), address)
        assert page.page.locator("#lost").is_hidden()
        assert page.page.locator("#following summary").inner_text() == "Following: represents the rig"
        forecast = Forecast(
            float(times[-1]), times[-1] + np.array([0.1, 0.2]), ("Mass.y",), np.ones((2, 10, 1)), np.zeros(1)
        )
        later = [estimate(float(time), nis=9.0) for time in times[200:]]
        later[10] = replace(later[10], alarm=Alarm("wear", later[10].time, 5.2, 0.99))
        later[-1] = replace(later[-1], forecast=forecast)
        recording._status_due = 0.0
        recording.write(later)
        page.page.wait_for_function("!document.getElementById('lost').hidden")
        page.drawn()
        assert page.page.locator("#lost").inner_text().startswith("The twin no longer represents the rig. NIS was in")
        curves = {curve["label"]: curve for pane in page.curves() for curve in pane["curves"]}
        assert curves["forecast, 0 % leave -1 to 1 m"]["y"] == [1.0, 1.0]
        assert "wear" in page.page.locator("#following").inner_text()
        recording.finish(later[-1], "completed", "", 1.0, {})
        page.page.wait_for_function("!document.getElementById('note').innerText.endsWith('in progress')")
        page.drawn()
        assert page.page.locator("#lost").is_visible()
        assert page.wrong == []
