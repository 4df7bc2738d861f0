"""The figures on the page about following are what comes out now."""

import re
from pathlib import Path

import pytest

from twin.face import load as load_scenario
from twin.follow import follow, in_band, load

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "follow.md").read_text()


@pytest.mark.slow
def test_figures_of_the_page(tmp_path, build, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r"Save this as `([^`]+)`:\n\n```yaml\n(.*?)```", PAGE, re.DOTALL):
        (tmp_path / name).write_text(text)
    load_scenario("rig.yaml").run(build=build, report=False)
    estimates = list(follow(load("sheath.yaml"), build))
    quoted = re.search(
        r"is (\S+) mm with a standard deviation of (\S+) mm at 10 s, and (\S+) mm with (\S+) mm at 20 s. (\d+) %", PAGE
    )
    half = min(estimates, key=lambda one: abs(one.time - 10.0))
    values = [1e3 * value for one in (half, estimates[-1]) for value in (one.values[0], one.deviations[0])]
    assert [f"{value:.2f}" for value in values] == list(quoted.groups()[:4])
    assert f"{100.0 * in_band(estimates):.0f}" == quoted[5]
