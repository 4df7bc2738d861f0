"""The benchmarks run: one repeat, few steps."""

import subprocess
import sys

import pytest

from benchmarks import digests, force, injection, isolate, iterate, mapped_rows, peers, rig, ring, startup, study
from benchmarks.parts import Drift, Relay
from twin.fmi.exporting import exporter

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the C loop loads Linux libraries")


@pytest.fixture
def build(build, monkeypatch):
    monkeypatch.setattr(ring, "BUILD", build / "tests")
    return build / "tests"


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_both_loops_of_the_ring_give_the_same(build, version):
    path = exporter.build(Relay, version, build)
    ours, last = ring.time_ours(path, 2, 20)
    theirs, c_last = ring.time_c(ring.c_loop(), version, path, 2, 20)
    assert last == c_last == 2.0 - 0.5**20
    assert ours > 0
    assert theirs > 0


@pytest.mark.slow
def test_what_iterating_costs(build):
    took, sweeps = iterate.time_ours(exporter.build(Drift, "3.0", build), 3, 50)
    assert took > 0
    assert 1 < sweeps < 20
    assert iterate.time_force("step_doubling", "22 s") > 0


@pytest.mark.slow
def test_isolated_members_are_measured(build, capsys):
    isolate.main(2, 5)
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert all(float(lines[f"isolate_{count}_us"]) > 0 for count in (1, 2, 4))


@pytest.mark.slow
def test_peers_that_are_there_are_measured_and_others_named(build, capsys):
    peers.compare(("ours", "fmpy", "unheard_of"), (2,), 1, 0.001)
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert float(lines["peers_2_ours_ratio"]) > 0
    assert float(lines["peers_2_fmpy_ns"]) > 0
    assert lines["peers_2_unheard_of"].startswith("not available (KeyError")


def test_wrong_values_of_a_peer_are_found(monkeypatch):
    values = peers.reference(3, 20)
    monkeypatch.setattr(peers, "measure", lambda *_: (1.0, values[1:] + values[:1]))
    with pytest.raises(RuntimeError, match="other values after 20 steps"):
        peers.checked("ours", None, 3, 20)


@pytest.mark.slow
def test_a_process_ends_at_the_first_step_with_its_phases(tmp_path):
    command = [sys.executable, "-m", "benchmarks.startup", "0", *startup.ARGUMENTS, str(tmp_path)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(",") == len(startup.PHASES) - 1


@pytest.mark.slow
def test_copies_of_a_member_take_its_inputs_and_are_not_recorded():
    scenario = force.load_scenario(force.SCENARIO)
    case, catalog = scenario.variants[0], force.resolve_catalogs(scenario)["PI"]
    more, wider = force.with_copies(case, catalog, "wall")
    assert len(more.members) == len(case.members) + force.COPIES
    assert len(more.connections) == len(case.connections) + 2 * force.COPIES
    assert more.record.select(wider) == case.record.select(catalog)


@pytest.mark.slow
def test_distribution_over_seeds_prints_every_metric(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(injection, "BUILD", tmp_path)
    injection.measure(2, ["seeds"])
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert 0.05 < float(lines["injection_seeds_calibrated_rms_z_mean"]) < 0.3
    assert float(lines["injection_seeds_unmodified_rms_z_below_paper"]) in (0.0, 0.5, 1.0)
    assert "injection_seeds_calibrated_t_test_y_above_0.05" in lines


@pytest.mark.slow
def test_rig_is_measured_with_all_its_members(capsys):
    rig.measure(("stop_time=1.5 s",), repeats=1)
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert float(lines["rig_fmu_factor"]) > 0
    shares = [float(value) for name, value in lines.items() if name.endswith("_share")]
    assert len(shares) == 12  # 11 members and the rest
    assert sum(shares) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_digests_of_a_scenario_are_those_of_its_values(build, tmp_path):
    """The same scenario again is equal to the bit; a signal that differs is named."""
    file = tmp_path / "digests.txt"
    digests.write(file, ["guided_injection"], build)
    first = digests.read(file)
    assert first["guided_injection", "", "", "status"] == "completed"
    digests.write(file, ["guided_injection"], build)  # is there already
    assert digests.read(file) == first
    again = digests.scenario_digests("guided_injection", build)
    assert not digests.compare(first, again)
    key = max(again)
    assert digests.compare(first, again | {key: digests.digest([0.0])}) == [key]


@pytest.mark.slow
def test_rows_in_a_mapped_file_are_measured(tmp_path, capsys):
    mapped_rows.measure(tmp_path, 0.5)
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert float(lines["mapped_rows_busy_file_max_us"]) > 0


@pytest.mark.slow
def test_cases_with_a_common_prefix_are_measured(tmp_path, capsys):
    study.measure_prefix(tmp_path, 2)
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert float(lines["study_prefix_2_to_whole"].partition(" ")[0]) > 0
    assert lines["study_prefix_2_to_whole"].endswith("simulated time: 0.727")
