"""A page in which the samples are: nothing else is needed, and what it holds is what was recorded."""

import base64
import json
import re
import zlib

import numpy as np
import pytest

from tests.viewer.recorded import FORCE, beats, folder_of, runs, wave
from twin.cli.view import ViewOptions, view_signals
from twin.errors import TwinError
from twin.results.recording.run_folder import RecordedVariable
from twin.viewer import page

ABOUT = re.compile(r'<script id="about" type="application/json">(.*?)</script>', re.DOTALL)
PACKED = re.compile(r'<script class="packed" type="text/plain">(.*?)</script>')


def arrays(text):
    return [np.frombuffer(zlib.decompress(base64.b64decode(one))) for one in PACKED.findall(text)]


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    time, force = wave(1000.0, 2.0)
    cases = {("PI", seed): (time, {"sensor.force": seed * force}) for seed in (1, 2)}
    return runs(folder_of(tmp_path_factory.mktemp("page") / "run", cases, [FORCE]))


def test_samples_are_in_the_page_once(opened):
    time, force = wave(1000.0, 2.0)
    written = page.embedded_page(opened, ["sensor.force", "abs(sensor.force)"], [0, 1])
    told, found = json.loads(ABOUT.search(written.text)[1]), arrays(written.text)
    assert (written.curves, written.thinned, len(found)) == (4, 0, 5)  # and the times of all of them once
    for one in told["embedded"]:
        value = (one["case"] + 1) * force
        np.testing.assert_array_equal(found[one["x"]], time)
        np.testing.assert_array_equal(found[one["y"]], np.abs(value) if "abs" in one["signal"] else value)
    assert len(written.text) - sum(map(len, PACKED.findall(written.text))) < 190_000  # the page itself


def test_signals_of_failed_requirements_are_in_a_page_of_others(tmp_path, capsys):
    run = beats(tmp_path)
    written = page.embedded_page(runs(run), ["heart.velocity"], [0, 2])
    told = json.loads(ABOUT.search(written.text)[1])
    assert (written.signals, written.added, told["shown_signals"]) == (2, 1, ["heart.velocity"])
    assert {each["signal"] for each in told["embedded"]} == {"heart.velocity", "heart.position"}
    assert told["film"] is None or told["film"]["case"] == 2  # that fails
    chosen = {
        "title": "",
        "variant": "",
        "seed": None,
        "patterns": ("heart.velocity",),
        "rate": 25.0,
        "speed": 1.0,
        "port": None,
    }
    view_signals([run], ViewOptions(**chosen, output=tmp_path / "page.html", no_open=True), tmp_path / "page.html")
    assert capsys.readouterr().out.startswith("signals: 2 (1 of them of failed requirements), curves: ")


def test_a_page_has_all_seeds_and_what_metrics_compare_with_the_paper(tmp_path, monkeypatch):
    opened = runs(beats(tmp_path))
    told = json.loads(ABOUT.search(page.embedded_page(opened, [], [0, 2], [0, 1, 2, 3]).text)[1])
    assert {each["signal"] for each in told["embedded"]} == {"heart.position", "heart.velocity"}
    assert told["shown"] == [0, 1, 2, 3]
    monkeypatch.setattr(page, "MAX_TOTAL", 1000)  # too large
    told = json.loads(ABOUT.search(page.embedded_page(opened, [], [0, 2], [0, 1, 2, 3]).text)[1])
    found = {(each["case"], each["signal"]) for each in told["embedded"]}
    assert (told["shown"], found) == ([0, 2], {(0, "heart.position"), (2, "heart.position")})


def test_nothing_is_loaded_and_nothing_escapes_its_script(tmp_path):
    time, force = wave(100.0, 1.0)
    evil = RecordedVariable("a.</script><script>alert(1)//", description="<!--<script>", unit="N")
    cases = {("</script>", 1): (time, {evil.name: force})}
    text = page.embedded_page(runs(folder_of(tmp_path / "run", cases, [evil])), [evil.name], [0]).text
    assert text.count("</script>") == len(re.findall(r"<script[ >]", text))
    assert "alert(1)" not in re.sub(ABOUT, "", text)
    assert not re.search(r'(?:src|href)="(?!data:)|@import|url\((?!data:|#)', text)


@pytest.mark.slow
def test_of_many_samples_the_extremes_are_kept(tmp_path):
    time = np.arange(300_000) / 1e3
    force = np.sin(time)
    force[150_001] = 7.0
    written = page.embedded_page(
        runs(folder_of(tmp_path / "run", {("PI", 1): (time, {"sensor.force": force})}, [FORCE])), ["sensor.force"], [0]
    )
    _, y = arrays(written.text)
    assert (written.thinned, len(y) <= page.MAX_SAMPLES, y.max()) == (1, True, 7.0)


def test_a_page_that_no_browser_bears_is_refused(opened, monkeypatch):
    monkeypatch.setattr(page, "MAX_LETTERS", 1000)
    with pytest.raises(
        TwinError, match=r"1 curves make a page of .* MB.*Choose fewer with --signal, --variant and --seed\."
    ):
        page.embedded_page(opened, ["sensor.force"], [0])
