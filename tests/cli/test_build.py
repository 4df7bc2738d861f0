"""`twin build`: one line for each FMU, all problems at once."""

import pytest
from click.testing import CliRunner

from twin.cli.build import command


@pytest.mark.slow
def test_builds_then_leaves_alone(build, tmp_path):
    arguments = ["tests.fmi.parts:Failing", "--fmi", "2.0", "--build", str(tmp_path)]
    first = CliRunner().invoke(command, arguments)
    assert (first.exit_code, first.output.split()[3]) == (0, "built")
    again = CliRunner().invoke(command, arguments)
    assert again.output.split()[3] == "unchanged"
    assert (tmp_path / "2.0" / "Failing.fmu").exists()


@pytest.mark.slow
def test_all_problems_are_shown(tmp_path):
    names = ["tests.fmi.parts:Failed", "tests.fmi.nothing:Failed", "tests.fmi.parts:Stiff"]
    result = CliRunner().invoke(command, [*names, "--fmi", "3.0", "--build", str(tmp_path)])
    assert result.exit_code == 1
    assert "Did you mean 'Failing'" in result.output
    assert "there is no module tests.fmi.nothing" in result.output
    assert (tmp_path / "3.0" / "Stiff.fmu").exists()
