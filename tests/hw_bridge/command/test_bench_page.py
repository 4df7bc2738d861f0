"""The page of commissioning, built without a browser: texts, buttons, and the commands that they begin.

Over 400 lines: the steps of one page share its fixtures.
"""

import asyncio
import os
import subprocess
import threading
import time
from types import SimpleNamespace

import pytest

from hw_bridge.command import pages, step_order
from hw_bridge.command.bench.motion import READY
from hw_bridge.command.commissioning_steps import STEPS, prerequisite
from hw_bridge.command.pages import SIMULATED, TITLE, Page, fill
from hw_bridge.command.progress import Outcome
from hw_bridge.command.running_card import TILES, armed
from hw_bridge.command.typed import Typed
from twin import web
from twin.errors import TwinError
from twin.web import OperatorLock

LIMITS = "{position: [-20 mm, 30 mm], velocity: 100 mm/s, acceleration: 4 m/s^2}"
HOMING = ", homing: {method: 37, at: 4 mm}"
REAL = "interface: socketcan\nchannel: can0"
MOTIONS = ["power on for a jog", "move", "home", "step"]
LINE = "  position 1.00 mm from start, velocity 0.00 mm/s, current 0.00 A, Operation enabled   \r"
READING = ["scan", "status", "dump", "compare", "check"]
CHAIN = "Do step 5 (check), then 6 (direction, push) or 7 (direction, by hand)"
BUTTONS = [*READING, "push", "by hand", *MOTIONS, "reset", "restore", "enable", "disable"]


@pytest.fixture
def typed(tmp_path, monkeypatch):
    """A runner for a file of one drive and one module, whose commands are recorded in `typed.started`."""

    def make(bus="simulated: true", arm=False, homing=""):
        file = tmp_path / "bench.yaml"
        drive = f"  axis: {{node: 3, profile: faulhaber_v3, limits: {LIMITS}{homing}}}\n"
        file.write_text(
            f"{bus}\nnodes:\n{drive}modules:\n  valves: {{node: 9, outputs: {{0: a.b}}, safe_outputs: 0}}\n"
        )
        host = SimpleNamespace(
            hardware=file, arm=arm, drives_in_use="", build="build", lock=threading.Lock(), runs=tmp_path / "runs"
        )
        made = Typed(host)
        host.activities = {TITLE: made}
        made.started = []
        monkeypatch.setattr(Typed, "_start", lambda self, words, attended: self.started.append((words, attended)))
        return made

    return make


class Commissioned(Page):
    """The page after its person has skipped the steps before motion."""

    def __init__(self, *given):
        super().__init__(*given)
        self.commissioned.add("axis")

    def is_done(self, step, name):
        return step.word == "check" or super().is_done(step, name)  # it is never skipped


@pytest.fixture
def build():
    """Build the page: its elements by kind, labels and HTML as texts, in the order in which they were made."""
    nicegui = pytest.importorskip("nicegui")
    clients = []

    def build(runner, operates=True):
        client = nicegui.Client(nicegui.ui.page("/bench"), request=None)
        clients.append(client)

        async def filled():
            with pytest.MonkeyPatch.context() as patch, client:
                patch.setattr(nicegui.core, "loop", asyncio.get_running_loop())
                fill(runner.console, lambda: operates)
                await asyncio.sleep(0)  # what is refreshed at once

        asyncio.run(filled())
        elements = list(client.elements.values())
        ui = nicegui.ui
        buttons = [element for element in elements if isinstance(element, ui.button)]
        inputs = [element for element in elements if isinstance(element, ui.input)]
        return SimpleNamespace(
            labels=[element.text for element in elements if isinstance(element, ui.label) and element.text],
            hidden=[element.text for element in elements if isinstance(element, ui.label) and not element.visible],
            html=[element.content for element in elements if isinstance(element, ui.html)],
            inputs=[(element.props["label"], element.value, element.props["hint"]) for element in inputs],
            boxes=[element.text for element in elements if isinstance(element, ui.checkbox)],
            enabled={element.text: element.enabled for element in buttons if element.text},
            controls=[element.props["controls"] for element in elements if "controls" in element.props],
            buttons=buttons,
            charts=[element.parent_slot.parent.visible for element in elements if isinstance(element, web.Chart)],
            stepper=next(element for element in elements if isinstance(element, ui.stepper)),
            switches=[element for element in elements if isinstance(element, ui.switch)],
            spins=any(isinstance(element, ui.spinner) for element in elements),
        )

    yield build
    for client in clients:
        client.instances.pop(client.id)


def test_a_simulated_bench(typed, build):
    runner = typed(homing=HOMING)
    jog = next(step for step in STEPS if step.word == "jog")
    lifted = [prerequisite(jog, is_done, True) for is_done in (lambda _: False, lambda step: step.word == "check")]
    assert lifted == ["Do step 5 (check) first.", ""]  # it moves nothing: also for a drive that was commissioned before
    page = build(runner)
    assert list(page.enabled) == BUTTONS  # the module's are like the drive's
    assert {name for name, enabled in page.enabled.items() if not enabled} == {
        "by hand",
        "compare",
        "push",
        *MOTIONS,
        "enable",
    }
    assert page.labels.count("Dump first.") == 2
    assert page.labels.count(f"{CHAIN}, then 8 (jog) first.") == 3
    assert not any(label.startswith("Not checked") for label in page.labels)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pages, "Page", Commissioned)
        page = build(runner)
    assert {name for name, enabled in page.enabled.items() if not enabled} == {"by hand", "compare", "move"}
    cautions = [label for label in page.labels if label.startswith("Not checked")]  # amber, at each motion
    risk = "it may move the wrong way"
    assert cautions.count(f"Not checked: direction: {risk}.") == 2  # a jog, and power on
    assert cautions.count(f"Not checked: direction, jog: {risk}.") == 3
    looks = {step.props["name"]: step.props.get("caption") for step in page.stepper.default_slot.children}
    assert [title for title, caption in looks.items() if caption == "skipped: not checked"] == [
        "direction, push",
        "jog",
    ]
    for line in (f"check {runner.file}", f"direction axis -f {runner.file}", f"jog axis -f {runner.file}"):
        runner.progress.record(f"twin hil {line}", "axis", Outcome.DONE)
    page = build(runner)
    assert {name for name, enabled in page.enabled.items() if not enabled} == {"by hand", "compare", "move"}
    assert "Fill in either “by” or “to”." in page.labels
    assert page.stepper.value == "scan"
    for line in ("scan", "status axis", "dump axis"):
        runner.progress.record(f"twin hil {line} -f {runner.file}", "axis", Outcome.DONE)
    assert build(runner).stepper.value == "compare"
    runner.progress.record(f"twin hil compare axis -f {runner.file}", "axis", Outcome.DONE)
    assert build(runner).stepper.value == "move"  # one kind of direction is enough
    assert len(page.buttons) == len(READING) + len(BUTTONS)
    assert page.html[3] == '<p class="twin-state twin-good">simulated drives</p>'
    assert page.labels[-1] == "Each button runs the command that you would type; it is shown here."
    begin = page.labels.index("bench.yaml")
    assert page.labels[begin : begin + 5] == [
        "bench.yaml",
        f"{runner.file}: simulated: each command has a bus of its own",
        SIMULATED,
        "axis",
        "node 3, -20 mm to 30 mm, 100 mm/s, 4 m/s^2; limits are those of the hardware file",
    ]
    assert [text for text in page.labels if text.startswith("Method")] == ["Method 37, the reference position is 4 mm:"]
    assert "1. it does not move: where it stands is the reference" in page.labels
    assert any(text.endswith("80 % of limits.force; timeout 30 s.") for text in page.labels)
    assert "valves" in page.labels
    assert page.inputs == [
        ("speed", "2 mm/s", "up to 80 mm/s"),
        ("acceleration", "0.4 m/s^2", "up to 4 m/s^2"),
        ("at most, each way", "10 mm", "within the limits"),
        ("by", "", "before homing up to 10 mm"),
        ("to (from home)", "", "the drive is not homed"),
        ("speed", "2 mm/s", "up to 80 mm/s"),
        ("acceleration", "0.4 m/s^2", "up to 4 m/s^2"),
        ("by", "0.5 mm", "-2.5 mm to 2.5 mm"),
    ]
    start, verbose = (
        "count from here, not from home",
        "also reasons, the drive's own settings, and the effect of each limit",
    )
    assert page.boxes == [verbose, start, start, "find the gains that explain a difference", start]


@pytest.mark.parametrize(
    ("arm", "kind", "text", "off"),
    [
        (False, "good", "not armed: nothing moves from here", {"compare", "push", "by hand", "enable", *MOTIONS}),
        (True, "warn", "armed: drives may move", {"compare", "push", "by hand", "enable", *MOTIONS}),
    ],
)
def test_a_real_bench_without_homing(typed, build, arm, kind, text, off):
    """Manual motion, a reset and the removal of power need no arm."""
    runner = typed(REAL, arm)
    assert armed(runner) == (kind, text)
    page = build(runner)
    assert {name for name, enabled in page.enabled.items() if not enabled} == off
    assert page.labels.count("Real drives, not armed: end this console and start it with --arm.") == (0 if arm else 5)
    assert any(label.startswith("axis: has no `homing` in the hardware file.") for label in page.labels)
    assert f"{runner.file}: socketcan can0" in page.labels


def test_steps_are_skipped_after_a_question_that_names_them(typed, monkeypatch):
    runner, asked, switch = typed(homing=HOMING), [], SimpleNamespace(value=True)
    page = Page(runner.console, lambda: True, runner)

    async def confirm(question):
        assert not switch.value  # while it asks
        asked.append(question)
        return len(asked) > 1

    monkeypatch.setattr(step_order, "confirm", confirm)
    asyncio.run(step_order.change_order(page, "axis", switch, True))
    assert (page.commissioned, switch.value) == (set(), False)
    assert "step 6 (direction, push) or 7 (direction, by hand), 8 (jog)." in asked[0][0]
    asyncio.run(step_order.change_order(page, "axis", switch, True))
    assert (page.commissioned, switch.value) == ({"axis"}, True)
    asyncio.run(step_order.change_order(page, "axis", switch, True))  # of the switch, which follows the answer
    assert len(asked) == 2
    asyncio.run(step_order.change_order(page, "axis", switch, False))
    assert page.commissioned == set()
    for line in ("check", "direction axis", "jog axis"):
        runner.progress.record(f"twin hil {line} -f {runner.file}", "axis", Outcome.DONE)
    asyncio.run(step_order.change_order(page, "axis", switch, True))  # nothing is skipped
    assert (page.commissioned, len(asked)) == ({"axis"}, 2)


def test_a_page_may_be_closed_while_it_asks(monkeypatch):
    """It printed that a client is used after its end, and list.remove(x): x not in list."""
    nicegui = pytest.importorskip("nicegui")
    client = nicegui.Client(nicegui.ui.page("/bench"), request=None)

    async def asked():
        with client:
            return await step_order.confirm(["Skip?"])

    async def closed():
        monkeypatch.setattr(nicegui.core, "loop", asyncio.get_running_loop())
        answer = asyncio.create_task(asked())
        await asyncio.sleep(0.01)
        client.delete()
        return await answer

    assert asyncio.run(closed()) is False


def test_buttons_begin_commands(typed, build, monkeypatch):
    monkeypatch.setattr(Page, "run_as_operator", lambda _page, what: what())
    runner = typed()
    folder = runner.console.runs / "commissioning"
    clock = time.strptime("2026-01-02 03:04:05", "%Y-%m-%d %H:%M:%S")
    format_time = time.strftime
    monkeypatch.setattr(time, "strftime", lambda form, *_: format_time(form, clock))
    buttons = build(runner).buttons
    for name, node, words, options, attended in (
        ("scan", "axis", ["scan"], [], False),
        ("push", "axis", ["direction", "axis"], [], True),
        ("by hand", "axis", ["direction", "axis"], ["--by-hand"], True),
        ("status", "axis", ["status", "axis"], [], False),
        ("dump", "axis", ["dump", "axis"], [f"{folder}/axis_20260102_030405.dcf"], False),
        ("compare", "valves", ["compare", "valves"], [f"{folder}/valves_20260101_000000.dcf"], False),
        ("step", "axis", ["step", "axis"], ["--by=0.5 mm", f"--plot={folder}/axis_step.svg"], True),
        (
            "power on for a jog",
            "axis",
            ["jog", "axis"],
            ["--velocity=2 mm/s", "--acceleration=0.4 m/s^2", "--distance=10 mm"],
            True,
        ),
    ):
        own = [button for button in buttons if button.text == name]
        if name == "compare":  # of the latest dump of this node
            for at in ("20250101_000000", "20260101_000000"):
                (folder / f"valves_{at}.dcf").touch()
            (folder / "valves_2_20260303_000000.dcf").touch()
        (listener,) = own[-1 if node == "valves" else 0]._event_listeners.values()
        listener.handler(None)
        expected = [*words, "-f", str(runner.file), *options, "--build", "build"]
        assert runner.started.pop() == (expected, attended)
        assert folder.is_dir() is (name not in ("scan", "push", "by hand", "status"))


def test_the_numbers_of_the_steps_say_what_has_become_of_them(typed, build):
    runner = typed()
    check, scan = f"twin hil check -f {runner.file}", f"twin hil scan -f {runner.file}"
    runner.progress.record(scan, "", Outcome.DONE)
    runner.progress.record(check, "", Outcome.FAILED)
    runner.line, runner.running = f"twin hil status axis -f {runner.file}", True
    looks = {step.props["name"]: step.props for step in build(runner).stepper.default_slot.children}
    assert looks["scan"]["caption"].startswith("done 20")
    assert (looks["scan"]["done-icon"], looks["scan"].get("prefix")) == ("check", None)
    assert (looks["check"]["caption"], looks["check"]["error"]) == ("failed", True)
    assert (looks["status"]["caption"], looks["status"]["prefix"]) == ("running", "2")
    assert (looks["check"]["icon"], looks["check"]["error-icon"]) == ("close", "close")  # also of the chosen step
    assert (looks["dump"]["caption"], looks["compare"]["caption"]) == ("Save the drive", "Compare with the save")
    assert looks["direction, by hand"]["caption"].startswith("A simulated drive cannot be pushed by hand")
    runner.running = False
    runner.progress.record(check, "", Outcome.DONE)
    looks = {step.props["name"]: step.props for step in build(runner).stepper.default_slot.children}
    assert "error" not in looks["check"]
    for word in ("check", "jog"):  # one that was done before it was stopped stays done
        runner.progress.record(f"twin hil {word} {runner.file} axis", "axis", Outcome.NEUTRAL)
    looks = {step.props["name"]: step.props for step in build(runner).stepper.default_slot.children}
    assert [looks[name]["caption"][:7] for name in ("check", "jog")] == ["done 20", "not com"]
    assert (looks["jog"]["icon"], looks["jog"]["error-icon"]) == ("stop", "stop")


def test_a_dump_is_chosen(typed, build, monkeypatch):
    """The latest dump of the page at first, or any DCF file beside the hardware file."""
    from nicegui import ui

    monkeypatch.setattr(Page, "run_as_operator", lambda _page, what: what())
    runner = typed()
    folder = runner.console.runs / "commissioning"
    folder.mkdir(parents=True)
    paths = [folder / "axis_20260102_000000.dcf", folder / "axis_20260101_000000.dcf", runner.file.with_name("old.dcf")]
    for path in paths:
        path.touch()
    buttons = build(runner).buttons
    (compare, *_) = [button for button in buttons if button.text == "compare"]
    (choice,) = [each for each in compare.parent_slot.parent.default_slot.children if isinstance(each, ui.select)]
    assert list(choice.options.values()) == [path.name for path in paths]
    (listener,) = compare._event_listeners.values()
    for path in (paths[0], paths[2]):
        choice.value = str(path)
        listener.handler(None)
        assert runner.started.pop()[0] == ["compare", "axis", "-f", str(runner.file), str(path), "--build", "build"]


def test_a_changed_hardware_file_is_read_again(typed, build):
    """Its limits are shown, check and what follows has to be done again; what cannot be read keeps all buttons disabled."""
    runner = typed()
    for line in (f"check {runner.file}", f"direction axis -f {runner.file}", f"status axis -f {runner.file}"):
        runner.progress.record(f"twin hil {line}", "axis", Outcome.DONE)
    assert build(runner).enabled["power on for a jog"]
    assert not runner.reload()
    text = runner.file.read_text()
    runner.file.write_text(text.replace("velocity: 100 mm/s", "velocity: 50 mm/s"))
    with pytest.raises(
        TwinError, match=r"bench.yaml has changed and was read again\. Look at its limits, then check it"
    ):
        runner.begin("jog", "axis")
    assert runner.started == []
    page = build(runner)
    assert "node 3, -20 mm to 30 mm, 50 mm/s, 4 m/s^2; limits are those of the hardware file" in page.labels
    assert ("speed", "1 mm/s", "up to 40 mm/s") in page.inputs
    (notice,) = [label for label in page.labels if label.startswith("bench.yaml has changed and was read again at ")]
    assert notice not in page.hidden
    assert not page.enabled["power on for a jog"]
    assert f"{CHAIN} first." in page.labels
    assert page.stepper.value == "scan"
    looks = {step.props["name"]: step.props for step in page.stepper.default_slot.children}
    assert looks["status"]["caption"].startswith("done 20")  # of the node itself
    runner.begin("jog", "axis")  # what the page shows now
    runner.running = True
    runner.file.write_text("nodes: 1\n")
    assert not runner.reload()  # while a command runs
    runner.running = False
    assert runner.reload()
    page = build(runner)
    assert any("and cannot be used: " in label for label in page.labels)
    assert not any(page.enabled.values())
    with pytest.raises(TwinError, match=r"bench\.yaml"):
        runner.begin("scan")
    runner.file.write_text(text)
    assert runner.reload()
    page = build(runner)
    assert not page.enabled["power on for a jog"]  # checked before with this content, but the bus may have changed
    assert not any("has changed" in label for label in page.hidden)


def test_only_the_operator_acts_and_errors_are_shown(typed, monkeypatch):
    nicegui = pytest.importorskip("nicegui")
    notes, done = [], []
    monkeypatch.setattr(nicegui.ui, "notify", lambda text, **_: notes.append(text))
    monkeypatch.setattr(nicegui.ui, "context", SimpleNamespace(client=SimpleNamespace(is_deleted=False)))

    async def io_bound(function):
        function()

    monkeypatch.setattr(nicegui.run, "io_bound", io_bound)

    def refused():
        raise TwinError("refused")

    runner = typed()
    runner.console.operator_lock = OperatorLock("another")
    for operates, action in ((True, lambda: done.append(1)), (False, lambda: done.append(2)), (True, refused)):
        asyncio.run(Page(runner.console, lambda operates=operates: operates, runner).run_as_operator(action))
    assert (done, notes) == ([1], ["This page only watches: another page operates.", "refused"])


@pytest.mark.slow
def test_the_card_of_a_running_command(typed, build):
    runner = typed()
    runner.begin("jog", "axis", (), (10.0, "mm/s"))
    runner.running, runner._page = True, object()
    page = build(runner)
    assert page.labels[-1] == runner.line == f"twin hil jog axis -f {runner.file}"
    assert page.labels[0] == "powering on ... Keys have no effect yet."
    assert [text for text in page.labels if text in ("state", "position", "velocity", "current")] == list(TILES)
    assert (page.charts, page.labels.count("from start")) == ([True], 0)
    assert {name for name, enabled in page.enabled.items() if enabled} == {"End"}
    assert (page.enabled["End"], page.spins, page.controls) == (True, False, [])
    runner.text = f"axis: {READY}"
    assert build(runner).controls == []  # it has not reported Operation enabled
    runner.motion.process_output(LINE)
    page = build(runner)
    assert page.labels[0] == "ready: hold an arrow key or a button"
    ((control,),) = page.controls
    assert (control["name"], control["keys"]) == ("jog axis", ["ArrowRight", "ArrowLeft"])
    assert (control["low"], control["high"], control["unit"]) == (-10.0, 10.0, "mm/s")
    runner.word, runner._page = "status", None
    page = build(runner)
    assert ("End" in page.enabled, page.spins, page.controls) == (False, True, [])
    runner.running = False
    page = build(runner)
    assert (page.labels[-1], page.spins) == (runner.line, False)
    runner.motion.begin()
    assert build(runner).charts == [False]
    runner.motion.process_output(LINE)
    page = build(runner)
    assert (page.charts, page.labels.count("from start")) == ([True], 1)


@pytest.mark.parametrize(("word", "attended"), [("scan", False), ("jog", True)])
def test_a_command_runs_in_a_process_of_its_own(typed, monkeypatch, word, attended):
    start = Typed._start
    runner = typed()
    monkeypatch.setattr(Typed, "_start", start)
    ended, calls = threading.Event(), []

    class Process:
        def __init__(self, words, **options):
            calls.append((words, options))
            reading, self.writing = os.pipe()
            self.stdout, self.signals = os.fdopen(reading, "rb", 0), []

        def wait(self, timeout=None):
            assert ended.wait(10.0 if timeout is None else timeout)
            return 3

        def poll(self):
            return 3 if ended.is_set() else None

        def send_signal(self, number):
            self.signals.append(number)
            ended.set()

    monkeypatch.setattr(subprocess, "Popen", Process)
    runner.begin(word, "axis" if attended else "")
    ((words, options),) = calls
    assert words[2:5] == ["from twin.cli import main; main()", "hil", word]
    assert [item for item in words if item.startswith("--attended")] == [
        f"--attended={fd}" for fd in options["pass_fds"]
    ]
    assert len(options["pass_fds"]) == attended
    assert (options["stdin"], options["stderr"]) == (subprocess.DEVNULL, subprocess.STDOUT)
    assert options["start_new_session"] is True
    assert (options["env"]["COLUMNS"], options["env"]["PYTHONUNBUFFERED"]) == ("80", "1")
    assert (runner.running, runner.attended, list(runner.done)) == (True, attended, [])
    with pytest.raises(TwinError, match=rf"^twin hil {word} goes on"):
        runner.begin("status", "axis")
    os.write(runner.process.writing, b"first\rsecond\n")
    os.close(runner.process.writing)
    runner.close()
    assert runner.process.signals == [2]
    assert (runner.running, runner.attended, runner.text) == (False, False, "second\n")
    ((_, line, code),) = runner.done
    assert (line, code) == (runner.line, 3)
    assert runner.record().splitlines()[-1] == "    second"
    assert runner.changed == 3  # begun, printed, ended
    runner.stop()
    assert runner.process.signals == [2]
