"""`twin follow --rig`: which estimates are written and shown, how it ends, and the line on a terminal."""

import sys
from contextlib import nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.cli.replaced import Calls, replace
from twin.cli import follow_live
from twin.errors import SimulationError
from twin.follow.changes import Alarm

FILE = Path("a.yaml")


def estimate(time, width=1.0):
    """An estimate, with a measurement where its band has a width."""
    return SimpleNamespace(time=time, band=(0.0, width))


class Setting:
    """A rig whose estimates come in parts; an error or Ctrl-C among them ends them."""

    def __init__(self, monkeypatch, *parts):
        self.written, self.finished, self.given, self.shown = [], [], [], []
        self.line = SimpleNamespace(show=self.shown.append, warn=lambda _: None, say=None, fraction=0.0)
        problem = SimpleNamespace(experiment=SimpleNamespace(case=SimpleNamespace(start_ns=1_000_000_000)))
        recording = SimpleNamespace(write=self.written.append, in_band=0.5, status=None, folder=Path("runs/a/1"))

        def revisions():
            for part in parts:
                if isinstance(part, BaseException):
                    raise part
                yield part

        live = SimpleNamespace(revisions=revisions, messages=SimpleNamespace(summary=lambda: {"lost": 3}))

        def keep(*arguments):
            self.given.append(arguments)
            return problem if len(self.given) == 1 else live

        replace(monkeypatch, "twin.follow", load_live=keep, LiveFollowing=keep, EstimateRecording=lambda *_: recording)
        monkeypatch.setattr(follow_live, "LiveLine", lambda _: nullcontext(self.line))
        monkeypatch.setattr(follow_live, "finish", self.finish)

    def finish(self, _problem, _recording, tail, rig, outcome):
        status, failure, seconds = outcome
        assert 0.0 <= seconds < 60.0
        self.finished.append(([one.time for one in tail], rig, status, failure))

    def follow(self, duration=0, page=None):
        follow_live.follow_live(FILE, "udp://h:1", duration, Path("runs"), Path("build"), page)
        return self.finished.pop()


PARTS = [[], [estimate(1.0), estimate(2.0)], [estimate(1.5), estimate(2.5, 0.0)], [estimate(3.0)], [estimate(4.0)]]


def test_an_update_replaces_what_it_revises(monkeypatch):
    """From the time of its first estimate on. Those with measurements remain, and the last, once."""
    one = Setting(monkeypatch, *PARTS)
    assert one.follow() == ([1.0, 1.5, 3.0, 4.0], {"lost": 3}, "completed", "")
    assert [len(part) for part in one.written] == [2, 2, 1, 1]
    assert one.line.fraction == 0.5
    assert [shown and shown.time for shown in one.shown] == [None, None, 2.0, 2.5, 3.0]
    assert one.given[0] == (FILE, "udp://h:1")
    assert one.given[1][1:] == (Path("build"), None)


@pytest.mark.parametrize(
    ("times", "tail"),
    [
        ([[1.0, 2.0], [2.0]], [1.0, 2.0]),  # the same time again: replaced
        ([[1.0, 2.0], [2.1]], [1.0, 2.0, 2.1]),
        ([[1.0, 2.0, 3.0], [0.5]], [0.5]),
        ([[1.0, 2.0, 3.0], [1.5, 1.7]], [1.0, 1.5, 1.7]),
    ],
)
def test_revised_estimates(monkeypatch, times, tail):
    assert Setting(monkeypatch, *[[estimate(time) for time in part] for part in times]).follow()[0] == tail


@pytest.mark.parametrize(
    ("ending", "duration", "ended"),
    [([], 2.0, "wait"), ([KeyboardInterrupt()], 0.0, "close"), ([SimulationError("lost")], 0.0, "close")],
)
def test_a_page_stays_when_the_time_is_over_and_closes_otherwise(monkeypatch, ending, duration, ended):
    one, calls = Setting(monkeypatch, *PARTS[:4], *ending), Calls()

    def opened(*arguments):
        calls.append(arguments)
        return SimpleNamespace(wait=calls("wait"), close=calls("close"))

    monkeypatch.setattr(follow_live, "FollowPage", opened)
    with suppress(SystemExit):  # of the failure
        one.follow(round(duration * 1e9), "options")
    assert calls == [(Path("runs/a/1"), "options", None), (ended,)]


@pytest.mark.parametrize(("duration", "last"), [(1.9, 3.0), (2.0, 3.0), (2.1, 4.0), (0.0, 4.0)])
def test_following_ends_after_its_duration(monkeypatch, duration, last):
    """It counts from the start of the model, at 1 s."""
    assert Setting(monkeypatch, *PARTS).follow(round(duration * 1e9))[0][-1] == last


def test_what_ends_it_early(monkeypatch, capsys):
    assert Setting(monkeypatch, *PARTS[:3], KeyboardInterrupt()).follow()[2:] == ("completed", "")
    one = Setting(monkeypatch, *PARTS[:3], SimulationError("the rig is lost"))
    with pytest.raises(SystemExit) as caught:
        one.follow()
    assert (caught.value.code, capsys.readouterr().err) == (1, "failed: the rig is lost\n")
    assert one.finished.pop() == ([1.0, 1.5, 2.5], {"lost": 3}, "failed", "the rig is lost")


@pytest.mark.parametrize("parts", [[], [[]]])
def test_nothing_is_finished_before_anything_was_measured(monkeypatch, parts):
    with pytest.raises(SimulationError, match=r"a\.yaml: ended before anything was measured\."):
        Setting(monkeypatch, *parts).follow()
    with pytest.raises(SimulationError, match="the rig is lost"):
        Setting(monkeypatch, *parts, SimulationError("the rig is lost")).follow()


def test_the_folder_is_completed_and_shown(monkeypatch):
    """Its summary holds the notes of the problem and of the estimates, and what came from the rig."""
    calls = Calls()
    problem = SimpleNamespace(notes=["noted"], changes=("wear",))
    alarm = Alarm("wear", 1.5, 1.0, 0.99)
    tail = [estimate(1.0), estimate(2.0)]
    recording = SimpleNamespace(count=7, in_band=0.9, finish=calls("finish", Path("runs/a/1")))
    recording.status = SimpleNamespace(alarms=[alarm])
    replace(monkeypatch, "twin.follow", remarks=lambda *_: ["remark"], summary_of=lambda *_: {"method": "ekf"})
    monkeypatch.setattr("twin.results.link_latest", calls("latest"))
    monkeypatch.setattr(follow_live, "show", calls("show"))
    follow_live.finish(problem, recording, tail, {"lost": 3}, ("completed", "", 2.5))
    changes = [{"name": "wear", "time": 1.5, "onset": 1.0, "probability": 0.99}]
    follow = {"method": "ekf", "measurements": 7, "nis_in_band": 0.9, "changes": changes, "rig": {"lost": 3}}
    assert calls == [
        ("finish", tail[-1], "completed", "", 2.5, {"notes": ["noted", "remark"], "follow": follow}),
        ("latest", Path("runs/a/1")),
        ("show", problem, tail, [alarm], "7 times", 0.9, Path("runs/a/1")),
    ]


class Screen:
    """A stream that may be a terminal."""

    def __init__(self, is_terminal):
        self.text, self.isatty = "", lambda: is_terminal

    def write(self, text):
        self.text += text

    def flush(self):
        pass


@pytest.fixture
def line(monkeypatch):
    """The line of a problem with a length and a temperature, on a screen of 76 columns, at a time that a test sets."""
    problem = SimpleNamespace(
        rig=SimpleNamespace(sources=["s", "t"]),
        estimates=(
            SimpleNamespace(name="a.x", unit="m", display_unit="mm"),
            SimpleNamespace(name="a.T", unit="degC", display_unit=""),
        ),
    )

    def make(is_terminal):
        now = [100.0]
        monkeypatch.setattr(sys, "stderr", Screen(is_terminal))
        monkeypatch.setattr(follow_live, "open_console", lambda **_: SimpleNamespace(width=76))
        monkeypatch.setattr(follow_live.time, "monotonic", lambda: now[0])
        monkeypatch.setattr(follow_live, "say", lambda text, err: sys.stderr.write(f"{text}, {err}\n"))
        return follow_live.LiveLine(problem), now

    return make


NOW = SimpleNamespace(time=2.04, values=(2e-3, 20.0), deviations=(1e-3, 0.5))


@pytest.mark.slow
def test_a_line_shows_the_estimates_ten_times_a_second(line):
    """In display units: a temperature has an offset, its deviation has none. Events stand above it, then it is renewed."""
    shown, now = line(True)
    with shown:
        shown.fraction = 0.5
        shown.show(None)
        for now[0], shown.fraction in ((100.0, 0.1), (100.05, 0.2), (100.101, 0.3)):
            shown.show(NOW)
        shown.say("lost")
        shown.show(NOW)
        shown.write("y" * 100)
    text = "2.0 s  a.x 2 mm +- 1 mm  a.T 20 degC +- 0.5 degC  NIS in band "
    waiting, *lines, event, again, cut, end = sys.stderr.text.split("\r\033[K")[1:]
    assert (waiting, event, end) == ("waiting for s, t", "lost, True\n", "")
    assert (lines, again, cut) == ([f"{text}10 %", f"{text}30 %"], f"{text}30 %", "y" * 75)


def test_a_line_tells_when_the_twin_no_longer_represents_the_rig(line):
    """Once, and once more when it does again."""
    shown, _ = line(False)
    last = SimpleNamespace(time=3.25)
    for since in (None, 3.25, 3.25, None, None):
        shown.warn(SimpleNamespace(since=since, reason="NIS is large.", last=last))
    assert sys.stderr.text.splitlines() == [
        "3.2 s: The twin no longer represents the rig. NIS is large., True",
        "3.2 s: The twin represents the rig again., True",
    ]


def test_elsewhere_only_events_are_printed(line):
    shown, _ = line(False)
    with shown:
        shown.show(NOW)
        shown.say("lost")
    assert sys.stderr.text == "lost, True\n"
