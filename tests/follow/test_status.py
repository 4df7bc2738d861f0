"""Status of a followed rig: when the twin no longer represents it, and what a page shows of it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.follow.test_linear import estimate
from twin.follow import FollowStatus
from twin.follow.changes import Alarm
from twin.follow.forecast import Forecast


class Problem:
    """What the status reads of a problem."""

    estimates = ()
    changes = ()
    forecast = None


def judged(inside, begin=0.0, **more):
    """Estimates every 0.1 s whose NIS is in its band, or not."""
    return [estimate(begin + 0.1 * k, nis=1.0 if good else 9.0, **more) for k, good in enumerate(inside)]


def test_a_twin_represents_its_rig_until_nis_leaves_its_band_too_often():
    status = FollowStatus(Problem())
    status.add(judged([False] * 79))  # the first 3 s do not count, and the others are 49
    assert (status.since, status.reason) == (None, "")
    status = FollowStatus(Problem())
    status.add(judged([False] * 30 + [True] * 100))
    assert (status.since, status.fraction) == (None, 1.0)
    status.add(judged([False] * 10, 13.0))
    assert status.since is None  # 80 % of the last 5 s
    status.add(judged([False] * 2, 14.0))
    assert status.since == 14.0
    assert status.reason.startswith("NIS was in its 95 % band at 76 % of the last 5")  # 50 or 51, by rounding
    status.add(judged([True] * 50, 14.2))
    assert (status.since, status.reason) == (None, "")


def test_estimates_that_come_again_are_judged_again():
    status = FollowStatus(Problem())
    status.add(judged([True] * 80 + [False] * 20))
    assert status.since == pytest.approx(9.0)  # of 50, 11 are not in their band
    status.add(judged([True] * 40, 6.0))
    assert (status.since, status.fraction) == (None, 1.0)
    status.add([estimate(11.0, nis=0.0, band=(0.0, 0.0))])  # nothing was measured
    assert status.fraction == 1.0


def test_of_frequent_measurements_all_of_the_last_seconds_count():
    status = FollowStatus(Problem())
    status.add([estimate(0.01 * k, nis=1.0 if k < 1000 else 9.0) for k in range(1110)])
    assert status.fraction == pytest.approx(0.78, abs=0.003)
    assert status.since == pytest.approx(11.0, abs=0.02)


def test_what_no_listed_change_explains_is_not_represented():
    status = FollowStatus(Problem())
    status.add([estimate(1.0, changes=np.array([0.0, 0.96, 0.04]))])
    assert (status.since, status.reason) == (1.0, "No listed change explains the measurements.")
    status.add([estimate(1.1, changes=np.array([0.9, 0.06, 0.04]))])
    assert status.since is None


def test_the_file_of_a_page_has_changes_and_the_last_forecast(tmp_path):
    forecast = Forecast(1.0, np.array([1.5, 2.0]), ("Mass.y",), np.arange(20.0).reshape(2, 10, 1), np.array([np.nan]))
    settings = type("Settings", (), {"limits": {}})
    names = [type("Variable", (), {"name": name}) for name in ("Mass.x", "Mass.v")]
    problem = type("Followed", (Problem,), {"estimates": names, "forecast": settings, "changes": ("wear",)})()
    status = FollowStatus(problem)
    status.add([estimate(1.0, alarm=Alarm("wear", 1.0, 0.5, 0.99), forecast=forecast), estimate(1.2)])
    status.write(tmp_path)
    content = json.loads((tmp_path / "following.json").read_text())
    assert content["changes"] == [{"name": "wear", "time": 1.0, "onset": 0.5, "probability": 0.99}]
    assert (content["time"], content["represents"], content["looks_for_changes"]) == (1.2, True, True)
    assert content["estimates"]["Mass.v"] == {"value": 0.0, "deviation": 1.0}
    assert content["forecast"]["time"] == [1.5, 2.0]
    own = content["forecast"]["signals"]["Mass.y"]
    assert (own["median"], own["chance"], own["limits"]) == ([4.5, 14.5], None, [])
    status.add([estimate(0.9)])  # a late value: all since then is new
    assert status.content()["changes"] == []
