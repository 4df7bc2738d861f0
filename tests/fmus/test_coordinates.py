"""Around the feedforward controller: its C library, statistics, programs, and what every component of it must have."""

import subprocess
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from fmus.coordinate_feedforward import record, statistics
from fmus.coordinate_feedforward.model import CoordinateFeedforward
from fmus.coordinate_program.model import CoordinateProgram
from scipy import stats

import fmus
from tests.c_compilers import linking
from tests.every_case import every_case
from twin import compiler
from twin.compiler import library
from twin.component import Role, catalog, unit
from twin.errors import TwinError
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario

FOLDER = Path(fmus.__path__[0])
NAMES = (
    "calibration_program",
    "camera_tracker",
    "coordinate_feedforward",
    "coordinate_program",
    "pull_wire_catheter",
    "stepper_axis",
    "tendon_catheter",
)

MAIN = """
#include <stdio.h>
#include "coordinate_feedforward.h"

int main(void)
{
    static coordinate_feedforward_t part;
    double y, z, needle;
    coordinate_feedforward_init(&part);
    coordinate_feedforward_start(&part, 0.0);
    for (int k = 0; scanf("%la %la %la", &y, &z, &needle) == 3; k++) {
        part.target_y = y, part.target_z = z, part.target_needle_length = needle;
        for (int j = 0; j < 6; j++) {
            if (coordinate_feedforward_step(&part, 0.01 * (6 * k + j), 0.01)) return 1;
        }
        printf("%lld %lld %lld %d\\n", (long long)part.handle_steps, (long long)part.wire_steps,
               (long long)part.needle_steps, (int)part.refusal);
    }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.skipif(compiler.host() != "x86_64-linux", reason="the library of this machine is not built")
def test_the_c_library_gives_the_components_steps(tmp_path, build):
    library.export(CoordinateFeedforward, "coordinate_feedforward", tmp_path, build, ("x86_64-linux",), force=False)
    (tmp_path / "main.c").write_text(MAIN)
    command = [*linking("x86_64-linux"), "-std=c11", "-O2", "-Wall", "-Werror"]
    archive = "x86_64-linux/libcoordinate_feedforward.a"
    subprocess.run([*command, "main.c", archive, "-lm", "-o", "main"], cwd=tmp_path, check=True)
    targets = np.random.default_rng(1).uniform(0, (16e-3, 21e-3, 6.2e-3), (200, 3))
    text = "\n".join(" ".join(float(value).hex() for value in row) for row in targets)
    done = subprocess.run([tmp_path / "main"], input=text, capture_output=True, text=True, check=True)
    found = [[int(word) for word in line.split()] for line in done.stdout.splitlines()]
    part, expected = CoordinateFeedforward(), []
    part.start()
    for k, target in enumerate(targets):
        part.target_y, part.target_z, part.target_needle_length = target
        for j in range(6):
            part.advance(0.01 * (6 * k + j), 0.01)
        expected.append([int(part.handle_steps), int(part.wire_steps), int(part.needle_steps), int(part.refusal)])
    assert found == expected
    assert {row[3] for row in expected} == {0, 1, 2, 3}


def test_ends_are_the_last_samples_of_each_number():
    assert statistics.ends(np.array([0, 0, 1, 1, 1, 2, 3, 3])).tolist() == [4, 5, 7]


def test_p_values_are_those_of_the_textbook():
    rng = np.random.default_rng(2)
    target = rng.uniform(0, 15, 26)
    error = rng.normal(0.05, 0.2, 26)
    found = statistics.tests(error, target, target + error)
    t = error.mean() / (error.std(ddof=1) / np.sqrt(26))
    assert found["p_t"] == pytest.approx(2 * stats.t.sf(abs(t), 25))
    ratio = np.var(target + error, ddof=1) / np.var(target, ddof=1)
    assert found["p_f"] == pytest.approx(2 * stats.f.sf(max(ratio, 1 / ratio), 25, 25))
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(error**2)))


def test_refused_coordinates_do_not_count():
    number = np.repeat(np.arange(1.0, 7.0), 3)
    target = number * 1e-3
    refusal = np.where(number == 4, 1.0, 0.0)
    measured = target + np.where(number == 4, 1.0, np.where(number % 2 == 0, 1e-4, -1e-4))
    measured[::3] += 1.0  # still moving
    found = statistics.coordinates(number, target, target, target, measured, measured, measured, refusal)
    assert (found["count"], found["refused"]) == (5.0, 1.0)
    assert found["rms_y"] == pytest.approx(1e-4)
    assert np.isfinite(found["reached_y"]).sum() == 5


@pytest.mark.slow
def test_coordinates_fill_the_rectangle_and_depend_on_the_seed():
    seen = {}
    for seed in (1, 2):
        program = CoordinateProgram(seed=seed, z_maximum=10e-3)
        program.start()
        points = []
        for k in range(40):
            program.advance(6.0 * k, 0.02)
            points.append((float(program.target_y), float(program.target_z)))
            assert program.number == k + 1
            assert program.target_needle_length == 0.0
            program.advance(6.0 * k + 0.02, 5.98)
            assert 3e-3 <= program.target_needle_length <= 5e-3
        seen[seed] = np.array(points)
        assert np.all(seen[seed] > 0)
        assert np.all(seen[seed] < (15e-3, 10e-3))
        assert np.all(np.ptp(seen[seed], axis=0) > (12e-3, 8e-3))
    assert not np.any(seen[1] == seen[2])


def test_the_needle_table_has_15_cases():
    program = CoordinateProgram(order=1)
    program.start()
    cases = []
    for k in range(15):
        program.advance(6.0 * k, 6.0)
        cases.append((round(float(program.target_y) * 1e3, 2), round(float(program.target_needle_length) * 1e3, 2)))
    assert cases == [(y, length) for length in (3.0, 4.0, 5.0) for y in (0.0, 1.92, 6.05, 10.82, 14.68)]


@every_case("name", NAMES)
def test_units_exist_and_every_parameter_has_a_source(name):
    text = (next(FOLDER.glob(f"*/{name}/README.md"))).read_text()
    for variable in catalog.component(name).variables:
        unit.conversion(variable.unit, variable.display_unit, variable.name)
        if variable.role is Role.parameter:
            assert variable.source, variable.name
            assert f"| {variable.name} | " in text, variable.name
            assert variable.source in text, variable.name


@every_case("name", NAMES)
def test_initialization_can_be_repeated(name):
    instance = catalog.component(name)()
    instance.start(0.0)
    first = instance.record.copy()
    instance.advance(0.0, 0.1)
    instance.start(0.0)
    for variable in instance.variables:
        if variable.role is Role.output:
            np.testing.assert_array_equal(instance.record[variable.name], first[variable.name], variable.name)


@pytest.mark.slow
def test_a_runs_readings_are_those_that_the_calibration_reads(tmp_path, build):
    scenario = load_scenario(FOLDER.parent / "scenarios/stepper_calibration.yaml")
    run_scenario(
        scenario,
        RunOptions(backend=Backend.compiled, variants=["loaded"], seeds=[1], root=tmp_path, build=build, report=False),
    )
    found = record.readings(tmp_path / "stepper_calibration")
    assert list(found) == ["steppers"]
    steps, way = found["steppers"].T
    assert np.all(np.abs(steps) == 1600)
    assert np.all(steps * way > 0)
    assert np.mean(np.abs(way)) == pytest.approx(7.7, abs=0.05)
    with pytest.raises(TwinError, match="holds no run"):
        record.readings(tmp_path)


def test_the_wire_is_let_go_before_another_pull_and_only_then(native):
    part = native(CoordinateFeedforward, release=True)
    part.start(0.0)
    ticks = count()

    def told(y, z, needle, moving=False):
        part.target_y, part.target_z, part.target_needle_length, part.wire_moving = y, z, needle, moving
        assert part.advance(10e-3 * next(ticks), 10e-3) == 0
        return int(part.wire_steps)

    first = [told(8e-3, 5e-3, 0.0) for _ in range(6)]
    assert first[0] == 0 < first[-1]
    assert {told(8e-3, 5e-3, 3e-3) for _ in range(6)} == {first[-1]}  # the needle alone
    assert {told(6e-3, 5e-3, 3e-3, moving=True) for _ in range(20)} == {0}  # as long as the slide moves
    after = [told(6e-3, 5e-3, 3e-3) for _ in range(3)]
    assert 0 < after[-1] < first[-1]
