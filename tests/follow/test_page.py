"""The figures on the page about following are what comes out now."""

import re
from pathlib import Path

import pytest

from twin.face import load as load_scenario
from twin.fmi import exporter
from twin.follow import estimator, follow, in_band, load

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "follow.md").read_text()


def save(folder, monkeypatch):
    """Write the page's files to a folder, and go there."""
    monkeypatch.chdir(folder)
    for name, text in re.findall(r"Save this as `([^`]+)`:\n\n```yaml\n(.*?)```", PAGE, re.DOTALL):
        (folder / name).write_text(text)


@pytest.mark.slow
def test_figures_of_the_page(tmp_path, build, monkeypatch):
    save(tmp_path, monkeypatch)
    load_scenario("rig.yaml").run(build=build, report=False)
    estimates = list(follow(load("sheath.yaml"), build))
    quoted = re.search(
        r"is (\S+) mm with a standard deviation of (\S+) mm at 10 s, and (\S+) mm with (\S+) mm at 20 s. (\d+) %", PAGE
    )
    half = min(estimates, key=lambda one: abs(one.time - 10.0))
    values = [1e3 * value for one in (half, estimates[-1]) for value in (one.values[0], one.deviations[0])]
    assert [f"{value:.2f}" for value in values] == list(quoted.groups()[:4])
    assert f"{100.0 * in_band(estimates):.0f}" == quoted[5]


@pytest.mark.slow
def test_figures_of_the_exported_estimator(tmp_path, build, monkeypatch):
    save(tmp_path, monkeypatch)
    load_scenario("rig.yaml").run(build=build, report=False)
    exporter.export(estimator("sheath.yaml").component, "3.0", tmp_path / "estimator.fmu", build)
    run = load_scenario("watched.yaml").run(build=build, report=False)
    quoted = re.search(r"`estimator.estimate.sheath.play_3` ends at (\S+) mm, with a `deviation` of (\S+) mm", PAGE)
    values = [run[f"estimator.{name}.sheath.play_3"].values.ravel()[-1] for name in ("estimate", "deviation")]
    assert [f"{1e3 * value:.2f}" for value in values] == list(quoted.groups())
