"""The response to a step, beside the simulated drive's, and the gains that explain a difference."""

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hw_bridge import hardware
from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import step
from hw_bridge.commission.single_axis_session import SingleAxisSession, restrict_to_node
from hw_bridge.device import Drive, Motor
from hw_bridge.profiles import profile
from tests.hw_bridge.profiles import fast


def test_figures_of_a_response():
    time = np.arange(-0.05, 0.4, 0.005)
    way = np.where(time > 0.0, 2e-4 * (1.0 - np.exp(-np.maximum(time, 0.0) / 0.02)), 0.0)
    found = step.Response(time, way, 0.0 * way, 2e-4).figures()
    assert found["rise"] == pytest.approx(0.02 * np.log(9.0), abs=0.006)
    assert found["settled"] == pytest.approx(0.02 * np.log(20.0), abs=0.006)
    assert found["overshoot"] == 0.0
    never = step.Response(time, 0.5 * way, 0.0 * way, 2e-4).figures()
    assert np.isnan(never["settled"])
    assert np.isnan(never["rise"])


@pytest.mark.slow
def test_the_gain_that_was_changed_is_found(build):
    """A drive whose velocity loop is softer than the profile's, as if somebody had tuned it."""
    keys = restrict_to_node(hardware.load(Path("hw_bridge/benches/can0_faulhaber_v3.yaml")), "servomotor")
    keys = keys.model_copy(update={"simulated": True})
    motor = Motor(profile("faulhaber_v3").motor, build=build)
    motor.scale("velocity_gain", 0.4)
    bus = Bus()
    bus.attach(Drive(profile("faulhaber_v3"), 1, motor))
    hand = SingleAxisSession(keys, "servomotor", SimulatedNetwork(bus))
    with hand.enabled():
        real = step.response(hand, 0.3e-3)
    twin, gains, (before, after) = step.explain(real, keys, "servomotor", build)
    assert after < step.EXPLAINED * before
    assert gains["velocity_gain"] == pytest.approx(0.4, rel=0.15)
    assert gains.get("position_gain", 1.0) == pytest.approx(1.0, rel=0.1)
    assert twin.displacement[-1] == pytest.approx(0.3e-3, abs=2e-5)


@pytest.mark.slow
def test_the_command(build, tmp_path):
    plot = tmp_path / "step.svg"
    bench = "hw_bridge/benches/simulated_force.yaml"
    words = ["step", "servomotor", "-f", bench, "--plot", str(plot), "--build", str(build)]
    done = CliRunner().invoke(hil.command, words)
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.output.splitlines() if line.startswith(("servomotor ", "twin "))]
    assert [row[1:3] for row in rows] == [rows[0][1:3]] * 2  # the twin of a simulated drive does the same
    assert all(int(row[3]) <= 2 for row in rows)  # overshoot [%]
    assert max(map(len, done.output.replace(str(plot), "").splitlines())) <= 80
    assert plot.read_text().startswith("<svg ")
    assert "half of nodes.servomotor.limits.following_error" in str(
        CliRunner().invoke(hil.command, [*words, "--by", "3 mm"]).exception
    )


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", fast("epos4", "mclm"))
def test_the_step_of_a_bench_file_keeps_to_its_limits(build, tmp_path, name):
    """The one that is taken where nothing is said; a larger one that would not is refused before anything moves."""
    text = Path(f"hw_bridge/benches/can0_{name}.yaml").read_text().replace("bit_rate", "simulated: true\nbit_rate")
    text = re.sub(r"^(interface|channel):.*\n", "", text, flags=re.MULTILINE)
    file = tmp_path / "bench.yaml"
    file.write_text(text)
    keys = hardware.load(file).nodes["servomotor"]
    seen = []
    enabled = SingleAxisSession.enabled

    def watched(self, *args, **more):
        seen.append(self)
        return enabled(self, *args, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SingleAxisSession, "enabled", watched)
        words = ["step", "servomotor", "-f", str(file), "--plot", str(tmp_path / "a.svg"), "--build", str(build)]
        done = CliRunner().invoke(hil.command, words)
        assert done.exit_code == 0, f"{done.output}{done.exception}"
        assert len(seen) == 2
        for hand in seen:
            force = max(abs(one.current) for one in hand.samples) * hand.node.force_constant
            assert force < keys.limits.force
        if name == "epos4":
            seen.clear()
            refused = CliRunner().invoke(hil.command, [*words, "--by", "1 mm"])
            assert "the simulated drive meets a limit: servomotor: force" in str(refused.exception)
            assert len(seen) == 1, "that of the simulated drive alone"


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("motor", ["lm2070", "lm1247"])
def test_the_simulated_drive_is_set_up_for_the_motor_of_the_file(build, motor):
    node = {"node": 1, "profile": "mclm", "motor": motor}
    keys = hardware.HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": node}})
    found = step.simulated(keys, "axis", 0.5e-3, build, {})
    assert found.displacement[-1] == pytest.approx(0.5e-3, abs=5e-5)
