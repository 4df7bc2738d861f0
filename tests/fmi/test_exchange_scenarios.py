"""Model Exchange in scenarios, in Python and on the command line: the same trajectories as by steps of their own."""

import numpy as np
import pytest

import twin
from tests.fmi.exchange_parts import exchange_fmu
from twin.errors import TwinError
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario, parse_scenario

SCENARIO = """
stop_time: 0.4 s
step: 2 ms
members:
  heart:  {component: heart}
  sheath: {component: sheath, interface: model_exchange, solver: RK45}
  wall:   {component: wall, interface: model_exchange, solver_tolerance: 1e-8}
connections:
  - heart.position -> wall.heart_position
  - sheath.tip_position -> wall.tip_position
  - wall.force -> sheath.contact_force
record: {variables: ["wall.force", "sheath.tip_position"]}
"""


def run(text, tmp_path, build):
    outcome = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path / "runs", build=build, report=False)
    )
    assert outcome.run.status == "completed", outcome.run.reason
    return next(iter(outcome.tables.values())).values


@pytest.mark.slow
def test_members_of_our_own_are_integrated_together(tmp_path, build):
    together = run(SCENARIO, tmp_path, build)
    apart = SCENARIO.replace(", interface: model_exchange, solver: RK45", "")
    apart = run(apart.replace(", interface: model_exchange, solver_tolerance: 1e-8", ""), tmp_path, build)
    for name, values in together.items():
        assert values == pytest.approx(apart[name], rel=2e-2, abs=2e-3 * np.abs(apart[name]).max()), name
    assert together["wall.force"].max() > 0.1


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("solver: RK45", "solver: RK4", "solver 'RK4' is not known"),
        ("solver_tolerance: 1e-8", "solver_tolerance: 1e-8, solver: BDF", "with different solvers"),
        ("solver_tolerance: 1e-8", "solver_tolerance: 1e-8, communication_step: 4 ms", "step differently"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, build, old, new, text):
    changed = SCENARIO.replace(old, new)
    outcome = run_scenario(
        parse_scenario(changed, tmp_path / "s.yaml"), RunOptions(root=tmp_path, build=build, report=False)
    )
    reason = outcome.run.reason or outcome.run.runs[0].reason
    assert text in reason
    assert "\n" not in reason


def test_a_parameter_may_be_called_tolerance(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("stop_time: 1 s\nmembers:\n  command: {component: coaxial_command}\n")
    case = load_scenario(path, ["command.tolerance=1 mm", "command.solver_tolerance=1e-7"]).cases([])[0]
    assert set(case.members["command"].parameters) == {"tolerance"}
    assert case.members["command"].exchange.solver_tolerance == 1e-7


@pytest.mark.slow
def test_in_python(tmp_path):
    path = exchange_fmu(tmp_path, "Ball", "3.0")
    found = twin.simulate(path, stop_time=1.0, step_size="10 ms", solver="RK45", tolerance=1e-9)
    assert found["h"].iloc[20] == pytest.approx(1.0 - 0.5 * 9.81 * 0.2**2, abs=1e-12)
    with pytest.raises(TwinError, match="Co-Simulation is needed"):
        twin.simulate(path, interface="co_simulation")
    system = twin.System()
    system.add("ball", path, solver="RK45")
    with system.simulate("10 ms", stop=0.4) as simulation:
        simulation.advance(0.2)
        assert simulation["ball.h"] == pytest.approx(found["h"].iloc[20], abs=1e-9)
