"""A member in a process of its own that does not end."""

import signal
import time

import pytest

from twin.component import PythonComponent, output
from twin.coupling import CoSimulation, IsolatedMember, RecordMember
from twin.coupling.isolation import isolated_member

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="a member is isolated by POSIX")


class Endless(PythonComponent):
    """Counts, and never ends."""

    y = output("", "steps")

    def step(self, t, h):
        self.y += 1.0

    def close(self):
        time.sleep(3600)


@pytest.mark.slow
def test_what_it_computed_counts_though_it_never_ends(build, monkeypatch):
    monkeypatch.setattr(isolated_member, "CLOSE_TIMEOUT", 0.2)
    member = IsolatedMember(RecordMember("a", Endless()), build)
    run = CoSimulation({"a": member}, [], 1_000_000, build=build)
    run.initialize(0, 10_000_000)
    run.advance(10_000_000)
    run.terminate()
    assert run.recording().signals["a.y"].tolist() == list(range(11))
    assert member.log == ["did not return from termination within 0.2 s."]
    assert member not in IsolatedMember.living
