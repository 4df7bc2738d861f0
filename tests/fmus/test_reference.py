import pytest

from twin.component import Component, Int32, input, output
from twin.conformance import reference
from twin.errors import DeclarationError, SimulationError


class Mixed(Component):
    """One of each type."""

    force = input("N", "force", shape=(2,), nominal=3.0)
    lid = input("", "open", start=False)
    mode = input("", "mode", start=9, type=Int32, minimum=8, maximum=9)
    total = output("N", "total")
    shut = output("", "shut", start=False)

    def step(self, t: float, h: float) -> None:
        self.total = self.force[0] + self.force[1] + self.mode
        self.shut = not self.lid


class Failing(Component):
    """Fails after a while."""

    y = output("", "y")

    def step(self, t: float, h: float) -> int:
        return 3 if t > 0.01 else 0


def test_file_reads_back_to_the_bit(tmp_path):
    written = reference.record_reference(Mixed)
    path = reference.regenerate(Mixed, tmp_path / "expected.csv")
    found = reference.read(path, Mixed)
    assert found == written
    assert path.read_text().splitlines()[0] == "time,force[1],force[2],lid,mode,total,shut"
    assert reference.differences(found, reference.replay(Mixed, found)) == {}


def test_stimulus_keeps_to_the_declarations():
    rows = reference.stimulus(Mixed)
    assert len(rows) == 101
    assert rows[-1][0] == 0.1
    columns = list(zip(*rows, strict=True))
    assert max(abs(x) for x in columns[1]) <= 3.0
    assert columns[1] != columns[2]
    assert set(columns[3]) == {False, True}
    assert (columns[4][0], columns[4][-1]) == (9, 8)


def test_own_stimulus_and_differences():
    short = reference.record_reference(
        Mixed, [(0.0, 1.0, 2.0, False, 9), (1e-3, 1.0, 2.5, False, 9), (2e-3, 0.0, 0.0, True, 9)]
    )
    assert [row[-2] for row in short.rows] == [0.0, 12.0, 12.5]
    bent = reference.Trajectory(short.inputs, short.outputs, (*short.rows[:2], (*short.rows[2][:-2], 13.5, True)))
    assert reference.differences(short, bent) == {"total": 1.0}
    lost = reference.Trajectory(
        short.inputs, short.outputs, (*short.rows[:2], (*short.rows[2][:-2], float("nan"), True))
    )
    assert reference.differences(short, lost) == {"total": float("inf")}


def test_stale_file_says_what_to_do(tmp_path):
    path = tmp_path / "expected.csv"
    path.write_text("time,x\n0.0,1.0\n")
    with pytest.raises(DeclarationError, match=r"twin reference"):
        reference.read(path, Mixed)


def test_a_failing_step_is_reported():
    with pytest.raises(SimulationError, match="status 3 after 11 ms"):
        reference.record_reference(Failing)


def test_a_file_keeps_its_stimulus_when_it_is_written_anew(tmp_path):
    path = tmp_path / "expected.csv"
    rows = [(0.0, 1.0, 2.0, False, 9), (5e-3, 1.0, 2.5, True, 9)]
    reference.write(path, reference.record_reference(Mixed, rows))
    text = path.read_text()
    path.write_text(text.rsplit(",", 1)[0] + ",0\n")
    reference.regenerate(Mixed, path)
    assert path.read_text() == text
    path.write_text("time,x\n0.0,1.0\n")
    reference.regenerate(Mixed, path)
    assert len(reference.read(path, Mixed).rows) == reference.STEPS + 1
