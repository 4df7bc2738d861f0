"""Requirements of a session that has not ended: when each is judged, and what may still change."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("nicegui")

from twin.console.verdicts import SessionVerdicts

TEXT = """
stop_time: 0.5 s
members:
  heart: {component: heart}
metrics:
  late: {signal: heart.position, reduce: max, from: 0.2 s, to: 0.4 s, unit: mm}
expect:
  - {name: always, signal: heart.position, at_most: 3 mm}
  - {name: soon, signal: heart.position, from: 0.1 s, at_most: 1 mm}
  - {name: a metric, metric: late, at_least: 2 mm}
"""


@pytest.fixture
def verdicts(tmp_path):
    """Verdicts by name for a heart that is at 2 mm from 0.3 s on, recorded until a time [s]."""
    path = tmp_path / "beat.yaml"
    path.write_text(TEXT)

    def until(end):
        time = np.linspace(0.0, end, 101)
        position = np.where(time < 0.3, 0.0, 2e-3)
        catalog = SimpleNamespace(
            variant="base",
            seed=1,
            start=0.0,
            stop=0.5,
            signals={"heart.position": SimpleNamespace(recorded=True, unit="m")},
        )
        samples = SimpleNamespace(time=time, values={"heart.position": position})
        live = SimpleNamespace(catalog=catalog, done=[], read=lambda *_: samples)
        return {row.name: row.verdict for row in SessionVerdicts(path, live).rows()}

    return until


@pytest.mark.parametrize(
    ("end", "told"),
    [
        (0.05, {"always": "pass", "soon": "waiting", "a metric": "waiting"}),
        (0.15, {"always": "pass", "soon": "pass", "a metric": "waiting"}),
        (0.25, {"always": "pass", "soon": "pass", "a metric": "waiting", "late": ""}),  # it may still come right
        (0.35, {"always": "pass", "soon": "fail", "a metric": "pass", "late": ""}),
        (0.5, {"always": "pass", "soon": "fail", "a metric": "pass", "late": ""}),
    ],
)
def test_what_is_told_while_a_session_runs(verdicts, end, told):
    assert verdicts(end) == told
