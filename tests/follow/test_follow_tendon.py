"""Benchmark of the followed tendon robot, on recordings of the frozen model itself."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import follow_tendon
from twin.validation import load as load_validation
from twin.validation import read_frozen


def test_recordings_that_are_not_there_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv("TWIN_VALIDATION_DATA", raising=False)
    assert follow_tendon.main([]) == 1
    assert follow_tendon.main(["--data", str(tmp_path / "nothing")]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("no data folder is named. Use --data FOLDER")
    assert second.startswith(f"there is no data folder {tmp_path / 'nothing'}.")


def write_tendon_runs(folder, build):
    """Recordings of the frozen model itself: three short decaying sines with some noise."""
    path = folder / "tendon_robot" / "decaying"
    path.mkdir(parents=True)
    own = load_validation(follow_tendon.FILE, folder, build).open_set("decaying")
    values = read_frozen(follow_tendon.FILE)["decaying"].values
    time = np.arange(0.0, 6.0, 0.005)
    for number, frequency in enumerate((0.3, 0.4, 0.5)):
        tendon = 2.8 * (1.0 - np.exp(-time / 12.0) * np.cos(2.0 * np.pi * frequency * time))
        tip = own.rollout([1e-3 * tendon[:, None]], {**values, "start_position[1]": 0.157, "start_position[2]": 0.016})
        angle = np.degrees(tip[:, 0]) + 0.1 * np.random.default_rng(number).standard_normal(len(time))
        table = np.column_stack([time, tendon, angle, 1e3 * tip[:, 1:]])
        head = "Time,Tendon Disp.,Angle x,Pos x,Pos y,Pos z"
        np.savetxt(path / f"data_{number + 1}.txt", table, "%.6g", ",", header=head, comments="")


@pytest.mark.slow
def test_slack_of_a_tendon_is_followed_from_run_to_run(tmp_path, build, capsys, monkeypatch):
    write_tendon_runs(tmp_path, build)
    monkeypatch.setattr(follow_tendon, "BUILD", build)
    assert follow_tendon.main(["--data", str(tmp_path), "--seeds", "1"]) == 0
    lines = (line.removeprefix("follow_tendon_").split(": ") for line in capsys.readouterr().out.splitlines())
    spans = {name: tuple(map(float, text.split(", "))) for name, text in lines}
    assert spans["decaying_frozen_deg"][1] < 0.2
    assert spans["decaying_followed_deg"][1] < 0.4
    assert spans["decaying_slack_mm"][1] < 0.1
    assert spans["slackened_frozen_deg"][0] > 3.0
    assert spans["slackened_followed_deg"][1] < 0.2 * spans["slackened_frozen_deg"][0]
    assert 0.45 < spans["slackened_slack_mm"][0] < spans["slackened_slack_mm"][1] + 1e-9 < 0.75
