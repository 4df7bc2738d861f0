"""What cannot be translated to C is a problem of the scenario, before anything runs."""

import pytest

from twin.component import Component, output
from twin.scenario import members, parse_scenario

TEXT = """
stop_time: 1 s
members: {{plain: {{component: "{module}:Plain"}}, table: {{component: "{module}:Table"}}}}
variants: {{a: {{}}, b: {{}}}}
"""


class Plain(Component):
    """Constant."""

    y = output("m", "constant")

    def initialize(self):
        self.y = 1.0

    def step(self, t, h):
        self.y = 2.0


class Table(Component):
    """Constant from a dict, which C does not have."""

    y = output("m", "constant")

    def step(self, t, h):
        table = {1: 2.0}
        self.y = table[1]


def table_problems(build):
    return members.translation_problems(parse_scenario(TEXT.format(module=__name__), "s.yaml").variants, build)


@pytest.fixture
def no_plain(monkeypatch):
    monkeypatch.setattr(f"{__name__}.TEXT", TEXT.replace('plain: {{component: "{module}:Plain"}}, ', ""))


def test_a_component_that_is_no_c_is_reported_with_its_line(tmp_path, no_plain):
    (line,) = table_problems(tmp_path)
    assert line.startswith("s.yaml:3: member `table`: Table (")
    assert line.endswith("a dict allocates. Declare variables instead. Or use --backend interpreted.")


@pytest.mark.slow  # translates
def test_a_folder_that_cannot_be_written_hides_no_problem(tmp_path):
    (tmp_path / "file").touch()
    assert table_problems(tmp_path) == table_problems(tmp_path / "file") != []
