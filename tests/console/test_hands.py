"""The dead-man switch in a real browser: whatever becomes of page, browser, network or server, motion stops."""

import os
import re
import signal
import time
from contextlib import suppress

import pytest

from tests.console.served import CARRIAGE, console
from tests.web.browser import browser, chromium  # noqa: F401 - fixtures

pytestmark = pytest.mark.slow
PageError = pytest.importorskip("playwright.sync_api").Error

SIMULATED = (
    "{simulated: true, cycle: 5 ms, nodes: {servomotor: {node: 1, profile: faulhaber_v3, watch_contact: false}}}"
)
INPUT = "command.live_speed[1]"
SLOW = 2.0  # on a machine that is busy with other tests; the promise is tested in real time [s]
PROMISE = 0.2  # [s]
TICK = 1 / 30  # what another page sees is as old as this [s]


@pytest.fixture(scope="module")
def served(tmp_path_factory, build):
    """With simulated drives, whose dead-man time is that of real ones."""
    bench = tmp_path_factory.mktemp("bench") / "bench.yaml"
    bench.write_text(SIMULATED)
    options = ("--variant", "quiet", "--hardware", bench)
    with console(CARRIAGE, *options, runs=tmp_path_factory.mktemp("runs"), build=build) as one:
        yield one


@pytest.fixture
def page(served, browser):  # noqa: F811
    context = browser.new_context()
    one = context.new_page()
    one.set_default_timeout(60_000)  # loading a page takes a busy machine this long
    one.goto(served.address, wait_until="commit")
    one.wait_for_selector(".twin-control", timeout=60_000)
    one.wait_for_function("/^(paused|running)/.test(document.querySelector('#twin-how').textContent)")
    one.wait_for_function("!document.querySelector('.twin-control .way').disabled", timeout=10_000)
    if (run := one.locator("button[aria-label=run]")).is_visible():
        run.click()  # a press while paused moves nothing
    one.wait_for_function("document.querySelector('#twin-how').textContent.startsWith('running')")
    yield one
    context.close()


def press(page, watcher):
    """Hold the key that moves it, until it does, as the page and another page see it."""
    for _ in range(5):  # on a busy machine the browser may renew too late, which ends a press
        page.keyboard.down("ArrowUp")
        with suppress(PageError, TimeoutError, AssertionError):
            page.wait_for_function(
                "document.querySelector('.twin-control b').textContent.startsWith('20 ')", timeout=2000
            )
            watcher.hear(lambda told: told.get("held"), timeout=2)
            return
        page.keyboard.up("ArrowUp")
        watcher.hear(lambda told: "held" in told and not told["held"])
    raise AssertionError("it does not move")


def stopped(wire, lost, limit):
    """Seconds from the loss until the loop has the input at rest, as another page sees it."""
    begun = time.monotonic()
    lost()
    wire.hear(lambda told: not told.get("held"), timeout=limit + 5)
    return time.monotonic() - begun


def hide(page):
    page.evaluate(
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )


def debugger(page):
    """The debugger of a page, enabled before a time is measured."""
    if not hasattr(page, "debugger"):
        page.debugger = page.context.new_cdp_session(page)
        page.debugger.send("Debugger.enable")
    return page.debugger


def sleep(page):
    """Not a line of the page's script runs any more."""
    debugger(page).send("Debugger.pause")


LOSSES = {
    "let go": lambda page: page.keyboard.up("ArrowUp"),
    "hidden": hide,
    "asleep": sleep,
    "offline": lambda page: page.context.set_offline(True),
    "closed": lambda page: page.close(),
    "elsewhere": lambda page: page.goto("about:blank"),
    "stuck": lambda page: page.evaluate(
        "setTimeout(() => { const end = Date.now() + 1500; while (Date.now() < end); }, 0)"
    ),
}


def lose(served, page, how, limit):
    with served.wire() as watcher:
        debugger(page)
        press(page, watcher)
        assert stopped(watcher, lambda: LOSSES[how](page), limit) < limit


@pytest.mark.parametrize("how", ["hidden", "offline", "closed"])
def test_motion_ends_with_the_hand(served, page, how):
    lose(served, page, how, SLOW)


@pytest.mark.parametrize("how", ["let go", "asleep", "elsewhere", "stuck"])
def test_motion_ends_in_other_ways_too(served, page, how):
    lose(served, page, how, SLOW)


@pytest.mark.real_time
@pytest.mark.parametrize("how", LOSSES)
def test_within_the_promise(served, page, how):
    lose(served, page, how, PROMISE + TICK)


PAD = "navigator.getGamepads = () => [{id: 'pad', axes: [0, AXIS], buttons: []}]"  # as the browser would tell of one


def test_a_joystick_and_a_gamepad(served, page):
    with served.wire() as watcher:
        stick = page.locator(".twin-stick svg").bounding_box()
        x, y = stick["x"] + stick["width"] / 2, stick["y"] + stick["height"] / 2
        held = {}
        for _ in range(5):  # a slow browser renews late, which ends the motion until the page has seen all at rest
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x, y + 10, steps=2)
            with suppress(TimeoutError, AssertionError):
                held = watcher.hear(lambda told: told.get("held"), 5)["held"]
            page.mouse.up()
            watcher.hear(lambda told: "held" in told and not told["held"])
            if held:
                break
        assert held[INPUT] < 0
        held = {}
        for _ in range(5):
            page.evaluate(PAD.replace("AXIS", "0"))
            page.wait_for_timeout(500)
            page.evaluate(PAD.replace("AXIS", "-0.55"))  # forward is negative there; 10 % of it are dead
            with suppress(TimeoutError, AssertionError):
                held = watcher.hear(lambda told: told.get("held"), 5)["held"]
                break
        assert held == {INPUT: pytest.approx(0.01)}
        page.evaluate(PAD.replace("AXIS", "0.05"))
        watcher.hear(lambda told: "held" in told and not told["held"])


def test_it_stays_at_rest_until_it_is_pressed_anew(served, page):
    with served.wire() as watcher:
        press(page, watcher)
        LOSSES["stuck"](page)
        watcher.hear(lambda told: not told.get("held"))
        page.wait_for_timeout(1800)  # the key is still down, and the page renews again
        assert page.text_content("#twin-message").endswith("Release and press again.")
        assert page.text_content(".twin-control b").startswith("0 ")
        assert page.text_content(".twin-hands p[role=status]").startswith("Stopped by the dead-man switch")
        assert float(page.get_attribute(".twin-stick .knob", "cy")) == 0.0
        page.keyboard.up("ArrowUp")
        page.get_by_text("Motion lasts while you hold a control.").wait_for()
        press(page, watcher)


def test_a_key_that_is_held_and_moves_nothing_says_so_until_it_is_released(served, page):
    """After the page had no server for a while, and after it lost the focus: then the keyboard repeats the key."""
    note = page.locator(".twin-hands p[role=status]")
    with served.wire() as watcher:
        press(page, watcher)
        page.context.set_offline(True)
        watcher.hear(lambda told: not told.get("held"))
        page.context.set_offline(False)
        page.get_by_text("Stopped. Release and hold again.").wait_for()
        page.wait_for_timeout(1000)
        assert note.text_content() == "Stopped. Release and hold again."
        page.keyboard.up("ArrowUp")
        page.get_by_text("Motion lasts while you hold a control.").wait_for()
        press(page, watcher)
        page.evaluate("window.dispatchEvent(new Event('blur'))")
        watcher.hear(lambda told: not told.get("held"))
        page.keyboard.down("ArrowUp")  # as the repetition of a key that is down
        page.get_by_text("Stopped. Release and hold again.").wait_for()
        page.keyboard.up("ArrowUp")
        page.get_by_text("Motion lasts while you hold a control.").wait_for()


def test_the_loop_stops_when_the_server_is_killed(tmp_path, build):
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path / "runs", build=build) as served:
        with served.wire() as wire:
            tick = wire.ready()["tick"]
            for _ in range(10):
                wire.say(hold=INPUT, at=1, press=1, tick=tick)
                tick = wire.hear(lambda told: "tick" in told)["tick"]
            os.kill(served.process.pid, signal.SIGKILL)
        served.process.wait(10)
        end = time.monotonic() + 20
        while (
            not (found := list((tmp_path / "runs").glob("*/2*/operated.yaml"))) or ": 0.0" not in found[0].read_text()
        ):
            assert time.monotonic() < end, [one.read_text() for one in found]
            time.sleep(0.05)


def test_a_session_that_is_over_says_so_beside_its_controls(tmp_path, build, browser):  # noqa: F811
    """The list has the reason of each end of a motion; without drives it covers nothing, since it stands beside the controls."""
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path, build=build) as served:
        page = browser.new_page()
        page.goto(served.address, wait_until="commit")
        page.wait_for_function(
            "!(document.querySelector('.twin-control .way') ?? {disabled: true}).disabled", timeout=60_000
        )
        page.get_by_label("run", exact=True).click()
        with served.wire() as watcher:
            press(page, watcher)
            LOSSES["stuck"](page)
            watcher.hear(lambda told: not told.get("held"))
        page.wait_for_selector(".twin-done >> text=released by the dead-man switch")
        page.get_by_text("Stopped by the dead-man switch. Release and hold again.").wait_for()
        assert page.text_content("#twin-message") == ""
        page.click("#twin-stop")
        page.get_by_text("The session is over: controls have no effect.").wait_for()
        assert page.locator(".twin-control .way").first.is_disabled()
        assert page.text_content("#twin-message") == ""
        page.locator(".twin-done .twin-line", has_text=re.compile("^STOP$")).wait_for()
        assert not page.locator(".twin-stick").first.is_visible()
        page.set_viewport_size(
            {"width": 360, "height": 780}
        )  # on a telephone the result is first, and nothing covers it
        page.get_by_role("button", name="again", exact=True).wait_for(timeout=60_000)
        card, picture = (
            page.locator(each).first.bounding_box() for each in (".twin-hand > .twin-over", ".twin-picture")
        )
        assert 0 < card["y"] < card["y"] + card["height"] <= picture["y"]
        assert page.evaluate("getComputedStyle(document.querySelector('.twin-picture')).position") == "relative"
        page.get_by_label("one step of 1 ms").wait_for(state="hidden")


@pytest.mark.parametrize("path", ["", "bench"])
def test_a_page_without_its_server_says_what_stop_does_not_reach(tmp_path, build, browser, path):  # noqa: F811
    """On both pages: gray, with STOP disabled once nothing can arrive; as before when the server answers again."""
    bench = tmp_path / "bench.yaml"
    bench.write_text(SIMULATED)
    with console(CARRIAGE, "--variant", "quiet", "--hardware", bench, runs=tmp_path, build=build) as served:
        page = browser.new_page()
        page.goto(f"http://{served.host}/{path}?token={served.token}", wait_until="commit")
        page.wait_for_selector("text=you operate", timeout=60_000)
        if not path:
            page.wait_for_selector(".twin-control .way:enabled", timeout=60_000)  # the session is prepared
        warning = page.locator(".twin-disconnected")
        served.process.send_signal(signal.SIGSTOP)
        warning.wait_for(timeout=20_000)
        assert warning.text_content().startswith("No answer from the server: STOP may not reach the drives.")
        assert page.is_enabled("#twin-stop")
        served.process.send_signal(signal.SIGCONT)
        warning.wait_for(state="hidden")
        page.evaluate("""async () => { (await import("/console/channel.js")).channel.socket.onmessage = null; }""")
        warning.wait_for()  # the server is well, but no tick arrives on this socket
        warning.wait_for(state="hidden")
        served.process.kill()
        page.wait_for_selector("text=Connection lost: STOP does not reach the drives. Use the hardware emergency stop.")
        assert page.is_disabled("#twin-stop")
        if not path:
            page.wait_for_selector("text=No connection to the server: controls have no effect.")
        assert page.eval_on_selector(".q-page-container", "one => getComputedStyle(one).pointerEvents") == "none"
        page.close()


@pytest.mark.parametrize("path", ["", "bench"])
def test_a_computer_without_a_network_operates_its_own_server(tmp_path, build, browser, path):  # noqa: F811
    """The browser says that it is offline; STOP must work nevertheless, and is disabled until it can."""
    bench = tmp_path / "bench.yaml"
    bench.write_text(SIMULATED)
    with console(CARRIAGE, "--variant", "quiet", "--hardware", bench, runs=tmp_path, build=build) as served:
        page = browser.new_page()
        page.add_init_script("Object.defineProperty(navigator, 'onLine', {get: () => false})")
        page.goto(f"http://{served.host}/{path}?token={served.token}", wait_until="commit")
        page.wait_for_selector("text=you operate", timeout=60_000)
        page.evaluate("dispatchEvent(new Event('offline'))")
        page.wait_for_selector(".twin-disconnected")
        assert page.is_disabled("#twin-stop")
        page.locator(".twin-disconnected").wait_for(state="hidden")
        assert page.is_enabled("#twin-stop")
        page.close()


def test_stop_is_disabled_until_the_page_is_connected(tmp_path, build, browser):  # noqa: F811
    """A socket that does not open: STOP must not look as if it worked."""
    bench = tmp_path / "bench.yaml"
    bench.write_text(SIMULATED)
    with console(CARRIAGE, "--variant", "quiet", "--hardware", bench, runs=tmp_path, build=build) as served:
        page = browser.new_page()
        page.route_web_socket(re.compile("/wire"), lambda socket: None)
        page.goto(f"http://{served.host}/bench?token={served.token}", wait_until="commit")
        page.wait_for_selector("#twin-stop", timeout=60_000)
        assert page.is_disabled("#twin-stop")
        page.wait_for_selector("text=STOP may not reach the drives")
        page.close()
