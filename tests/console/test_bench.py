"""Commissioning in a real browser, on a drive in a process of its own: whatever becomes of who holds the button, it stands."""

import os
import signal

import pytest

from hw_bridge.command.control import request
from hw_bridge.fault import Cause, Fault
from tests.console.served import console
from tests.console.test_hands import hide, sleep
from tests.hw_bridge.commission.conftest import BENCH, drive_process, watching
from tests.hw_bridge.commission.test_jog import MS, off, place, stands
from tests.web.browser import browser, chromium  # noqa: F401 - fixtures

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

PROMISE = 0.2  # from the last renewal to a standstill [s]
STILL = 50e-6  # of a loop that closes in on its place [m]


@pytest.fixture(scope="module")
def drive(build, tmp_path_factory):
    with drive_process("faulhaber_v3", build, 45100 + os.getpid() % 4000) as found:
        found.file = tmp_path_factory.mktemp("bench") / "bench.yaml"
        found.file.write_text(
            BENCH.format(name="servomotor", profile="faulhaber_v3", channel=found.channel, port=found.port)
        )
        yield found


@pytest.fixture
def served(drive, tmp_path, build):
    with console("--hardware", drive.file, runs=tmp_path, build=build, path="bench") as one:
        yield one


@pytest.fixture
def page(served, browser):  # noqa: F811
    context = browser.new_context()
    one = context.new_page()
    one.set_default_timeout(30_000)
    one.wrong = []
    one.on("pageerror", lambda error: one.wrong.append(str(error)))
    one.on("console", lambda said: one.wrong.append(said.text) if said.type == "error" else None)
    one.goto(served.address, wait_until="commit")
    one.wait_for_selector("text=you operate")
    one.get_by_text("commissioned before").click()  # each test begins with the step that it is about
    one.wait_for_selector("text=not done with this drive and hardware file: step 6 (direction, push)")
    one.get_by_role("button", name="Skip these steps").click()
    opened(one, "check")  # it is never skipped
    one.get_by_role("button", name="check", exact=True).click()
    one.wait_for_selector("text=check: done")
    yield one
    context.close()


def opened(page, step):
    page.locator(".q-stepper__tab, .q-expansion-item__container", has=page.get_by_text(step, exact=True)).first.click()
    page.wait_for_timeout(400)  # it opens slowly


def said(page, text, seconds=30):
    page.wait_for_function(
        "text => document.querySelector('.twin-bench-said').textContent.includes(text)", arg=text, timeout=1e3 * seconds
    )


def test_the_state_is_read_between_commands_and_nothing_is_written(page, drive):
    """Unasked, in sight on a telephone; on the bus only requests to read (SDO upload, 40h); a command has the drive for itself."""
    rows, requests = page.locator(".twin-live span[title]"), []
    rows.first.wait_for()
    wide = page.viewport_size
    page.set_viewport_size({"width": 360, "height": 780})
    assert page.locator(".twin-live").bounding_box()["y"] < page.locator(".twin-hand").bounding_box()["y"]
    page.set_viewport_size(wide)
    with watching(drive) as bus:
        bus.network.observe(lambda _time, frame: requests.append(frame) if frame and frame.id < 0x680 else None)
        bus.wait(2_000 * MS)
    titles = {row.get_attribute("title") for row in rows.all()}
    assert {"6041h Statusword", "6064h Position actual value"} <= titles
    asked = [frame.data[0] for frame in requests if frame.id > 0x600]
    assert set(asked) == {0x40}
    assert not [frame for frame in requests if frame.id < 0x80 or 0x200 <= frame.id < 0x580]  # NMT, process data
    opened(page, "status")
    page.get_by_role("button", name="status").click()
    page.wait_for_selector("text=twin hil status runs: see its output.")
    said(page, "limits")
    rows.first.wait_for()
    page.get_by_role("button", name="pause live state").click()
    rows.first.wait_for(state="detached")
    assert page.wrong == []


def jogs(page):
    """Hold the key until it moves."""
    opened(page, "jog")
    page.get_by_label("speed").first.fill("10 mm/s")
    page.get_by_role("button", name="power on for a jog").click()
    page.wait_for_selector(".twin-control")
    page.wait_for_function("!document.querySelector('.twin-control .way').disabled")
    page.locator(".twin-own").click(position={"x": 3, "y": 3})
    for _ in range(5):  # on a busy machine the browser may renew too late, which ends a press
        page.keyboard.down("ArrowRight")
        try:
            said(page, "> ", 3)
        except Exception:
            page.keyboard.up("ArrowRight")
        else:
            return
    raise AssertionError("it does not move")


def place_now(line, node):
    """Where the drive is [m], after all answers to the console's own requests were taken from the socket."""
    line.wait(50 * MS)
    return place(node)


def crash(page):
    """As kill -9 of what shows the page."""
    with pytest.raises(Exception, match=r"crash|ERR_|Timeout"):
        page.goto("chrome://crash", timeout=1000)


LOSSES = {
    "let go": lambda page, _: page.keyboard.up("ArrowRight"),
    "hidden": lambda page, _: hide(page),
    "asleep": lambda page, _: sleep(page),
    "offline": lambda page, _: page.context.set_offline(True),
    "closed": lambda page, _: page.close(),
    "crashed": lambda page, _: crash(page),
    "server killed": lambda _, served: os.kill(served.process.pid, signal.SIGKILL),
    "stop": lambda page, _: page.click("#twin-stop"),
    "escape": lambda page, _: page.keyboard.press("Escape"),
}


@pytest.mark.parametrize("how", LOSSES)
def test_it_stands_within_200_ms_of_the_last_renewal(drive, served, page, how):
    """And has no power soon after, but where only the button was let go: that is what a jog is for."""
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        jogs(page)
        line.wait(100 * MS)
        begin = place(node)
        line.wait(50 * MS)
        assert place(node) - begin > 0.2e-3
        LOSSES[how](page, served)
        line.wait(round(PROMISE * 1e9))  # no renewal has come since
        there = place(node)
        line.wait(300 * MS)
        assert abs(place(node) - there) < STILL
        if how != "let go":
            assert off(line, node, 2.0)


def test_a_telephone_has_all_in_sight_and_values_of_a_lost_server_are_the_last_known(served, page):
    """No overflow and one line of buttons at 360 px, arrows in the order of - and +; nothing turns that has no server."""
    jogs(page)
    page.set_viewport_size({"width": 360, "height": 740})
    page.wait_for_timeout(300)
    assert page.locator(".twin-top").bounding_box()["height"] < 50
    wraps = page.locator(".twin-own .twin-soft").evaluate_all("all => all.map(e => getComputedStyle(e).overflowWrap)")
    assert set(wraps) == {"anywhere"}  # of a long path
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert page.locator(".twin-control kbd").all_inner_texts() == ["←", "→"]
    pinned = sum(page.locator(name).bounding_box()["height"] for name in (".twin-live", ".twin-hand"))
    assert pinned < 0.46 * 740
    served.process.kill()
    page.wait_for_selector(".twin-disconnected")
    label = "e => getComputedStyle(e, '::before').content"
    assert "last known" in page.locator(".twin-live").evaluate(label)
    bottom = page.locator(".twin-disconnected").bounding_box()
    assert page.locator(".twin-live").bounding_box()["y"] >= bottom["y"] + bottom["height"]
    assert not [one for one in page.locator(".q-spinner").all() if one.is_visible()]
    assert not page.locator(".twin-hand > .twin-state").is_visible()  # "moves to positive positions"


def test_the_steps_from_a_box_to_a_move(drive, page):
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        opened(page, "scan")
        page.get_by_role("button", name="scan").click()
        said(page, "node 1 (servomotor)")
        opened(page, "direction, push")
        page.get_by_role("button", name="push", exact=True).click()
        said(page, "and motor have the same sign")
        opened(page, "home")
        page.wait_for_selector("text=slowly to negative positions of the drive until it stands against its end stop")
        page.get_by_role("button", name="home", exact=True).click()
        said(page, "homed at -40 mm")
        said(page, "stopped and disabled")
        page.wait_for_selector(".twin-live >> text=-39.00 mm from reference")  # at once, and as it was left
        assert page.locator(".twin-live").inner_text().count("Switch on disabled") == 1
        begin = place_now(line, node)
        opened(page, "move")
        page.get_by_label("by", exact=True).locator("visible=true").first.fill("0 2 mm")
        page.wait_for_selector("text=expected a number with its unit")
        assert page.get_by_role("button", name="move", exact=True).is_disabled()
        page.get_by_label("by", exact=True).locator("visible=true").first.fill("2 mm")
        page.get_by_role("button", name="move", exact=True).click()
        page.wait_for_selector(".twin-live >> text=Operation enabled")  # the command's own values
        said(page, "from -39.00 mm to -37.00 mm")  # from the reference
        said(page, "is at -37.00 mm")
        said(page, "stopped and disabled")
        assert place_now(line, node) - begin == pytest.approx(2e-3, abs=0.1e-3)
        opened(page, "step")
        page.get_by_role("button", name="step", exact=True).click()
        page.wait_for_selector("img[alt='response to the step']")
        assert page.wrong == []


def test_a_reset_says_which_fault_it_clears_and_a_move_does_not_clear_it(drive, page):
    request(int(drive.control), Fault(Cause.EMCY, 0x7300))
    opened(page, "enable")
    page.get_by_role("button", name="enable", exact=True).click()
    page.wait_for_selector(".twin-result:has-text('7300h encoder')")
    page.wait_for_function("document.querySelector('.twin-typed').textContent.includes('exit code 1')")
    opened(page, "reset")
    page.get_by_role("button", name="reset", exact=True).click()
    said(page, "Reset: Switch on disabled")
    assert "7300h encoder" in page.text_content(".twin-bench-said")


def test_a_move_that_no_page_shows_any_more_ends(drive, page):
    with watching(drive) as line:
        node = line.drive("1", "faulhaber_v3")
        opened(page, "move")
        page.get_by_label("by", exact=True).locator("visible=true").first.fill("9 mm")
        page.get_by_role("button", name="move", exact=True).click()
        page.wait_for_selector(".twin-live >> text=Operation enabled")  # the command's own values
        said(page, "from 0.00 mm to 9.00 mm")
        begin = place(node)
        page.close()
        stands(line, node, 2.0)
        assert off(line, node, 2.0)
        assert abs(place(node) - begin) < 8e-3


def test_another_page_watches_it(drive, served, page, browser):  # noqa: F811
    other = browser.new_context().new_page()
    other.goto(served.address, wait_until="commit")
    other.wait_for_selector("text=you watch")
    other.get_by_role("button", name="scan").click()
    other.wait_for_selector("text=This page only watches")
    jogs(page)
    other.wait_for_selector(".twin-control")
    assert other.locator(".twin-control .way").first.is_disabled()
    with watching(drive) as line:
        other.click("#twin-stop")  # whoever sees a danger
        assert off(line, line.drive("1", "faulhaber_v3"), 1.0)


def test_a_page_that_answers_late_is_not_offered_a_motion(drive, page):
    opened(page, "move")
    page.evaluate("setTimeout(() => { const end = Date.now() + 400; while (Date.now() < end); }, 0)")
    page.locator("text=too slow to move").locator("visible=true").first.wait_for()
    assert page.get_by_role("button", name="move", exact=True).is_disabled()


def test_a_page_that_answers_late_says_so_and_a_stopped_move_what_to_do(drive, page):
    """After a pause that is shorter than its limit it warns; after one that is longer the drive stands, in amber."""
    opened(page, "move")
    assert page.get_by_text("Not checked: direction, jog: it may move the wrong way.").locator("visible=true").count()
    page.get_by_label("by", exact=True).locator("visible=true").first.fill("9 mm")
    page.get_by_role("button", name="move", exact=True).click()
    page.wait_for_selector(".twin-tiles >> text=Operation enabled")
    busy = "setTimeout(() => { const end = Date.now() + %d; while (Date.now() < end); }, 0)"
    page.evaluate(busy % 300)
    page.wait_for_selector("text=This page answers late: 0.")
    page.evaluate(busy % 1500)
    page.wait_for_selector(".twin-result.twin-warn >> text=this page did not answer for 0.5 s")
    page.wait_for_selector(".twin-result >> text=Power is off (Switch on disabled), at ")
    page.wait_for_selector(".twin-result >> text=copy the command above into a terminal")
    for width in (1400, 900, 360):  # the output does not part its sentences at a width of its own
        page.set_viewport_size({"width": width, "height": 780})
        for row in page.locator(".twin-bench-said > div:not(.twin-row)").all():
            assert row.evaluate("e => e.scrollWidth <= e.clientWidth + 1")


def test_a_jog_that_its_dead_man_switch_has_ended_says_so(page):
    """The page was busy for longer than the switch waits, and not as long as the command; the button is still held."""
    jogs(page)
    page.evaluate("setTimeout(() => { const end = Date.now() + 300; while (Date.now() < end); }, 0)")
    page.wait_for_selector("text=Stopped by the dead-man switch: this page answered later than 120 ms.")
    page.wait_for_selector("text=Release and hold again.")
    said(page, "dead-man switch.")
    page.keyboard.up("ArrowRight")
    page.keyboard.down("ArrowLeft")
    said(page, "< position")
    page.keyboard.up("ArrowLeft")
    page.wait_for_selector("text=ready: hold an arrow key or a button")
    said(page, "released.")
