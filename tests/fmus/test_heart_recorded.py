"""A recorded motion becomes the parameters of `heart`."""

import subprocess
import sys

import numpy as np
import pytest
import yaml
from fmus.heart.model import Heart
from fmus.heart.recorded import parameter_set

from twin.scenario import load_scenario

MOTION = {"rate": 1.17, "scale": 0.7, "offset": 1.5e-3, "respiration": 2e-3, "respiration_rate": 0.23, "blend_in": 0.0}


def written(path, noise=1e-4, spacing=0.03, **values):
    heart = Heart(**{**MOTION, **values})
    generator = np.random.default_rng(1)
    rows = ["time [ms],sound [V],position [mm]"]
    for t in np.arange(0.0, 18.0, spacing):
        heart.start(t)
        rows.append(f"{1e3 * t + 250:.1f},0,{1e3 * (heart.position + generator.normal(0.0, noise)):.5f}")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.slow
def test_the_parameters_give_the_motion_back_in_a_scenario(tmp_path):
    text = parameter_set(written(tmp_path / "mine.csv"))
    (tmp_path / "mine.yaml").write_text(text)
    (tmp_path / "scenario.yaml").write_text(
        "parameter_sets: mine.yaml\nstop_time: 1 s\nstep: 1 ms\nmembers: {heart: {component: heart}}\n"
    )
    load_scenario(tmp_path / "scenario.yaml")
    found = yaml.safe_load(text)["heart"]
    assert float(found["rate"].removesuffix(" Hz")) == pytest.approx(1.17, abs=1e-3)
    size = [float(one.removesuffix(" mm")) for one in found["amplitude"]]
    assert size[:4] == pytest.approx([2.8, 1.4, 0.28, 0.07], abs=0.015)
    assert found["phase"][1:3] == pytest.approx([2.8, 2.8], abs=0.1)
    assert float(found["respiration"].removesuffix(" mm")) == pytest.approx(2.0, abs=0.02)
    assert float(found["respiration_rate"].removesuffix(" Hz")) == pytest.approx(0.23, abs=1e-3)
    assert text == parameter_set(tmp_path / "mine.csv")


@pytest.mark.slow
def test_what_is_no_recording_is_told(tmp_path):
    path = tmp_path / "mine.csv"
    time = 0.02 * np.arange(900)
    cases = {
        "time [s],position [V]\n": "`position [V]` does not convert to m",
        "time,position\n0,1\n": "expected two columns with units",
        "time [s],position [mm]\n0,0\n1,x\n": "row 3: `position` is not a number",
        "time [s],position [mm]\n0,0\n0,1\n2,3\n": "times must rise",
        "time [s],position [mm]\n0,0\n1,1\n2,3\n": "Expected 10 s or more",
        "time [s],position [mm]\n"
        + "\n".join(
            f"{t},{x}" for t, x in zip(time, np.random.default_rng(2).normal(size=900), strict=True)
        ): "explains half of it",
    }
    for text, expected in cases.items():
        path.write_text(text)
        with pytest.raises(ValueError, match=r"mine\.csv") as caught:
            parameter_set(path)
        assert expected in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match="ms apart do not show 7 harmonics"):
        parameter_set(written(path, spacing=0.1))


@pytest.mark.slow
def test_as_a_command():
    done = subprocess.run([sys.executable, "-m", "fmus.heart.recorded"], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == "recorded: no file named. Expected one .csv.\n"
