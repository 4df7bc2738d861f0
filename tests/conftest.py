"""Shared by all tests: one build folder, so that nothing is compiled twice; what runs on one core, and in which order.

Property tests draw the same every time, and an eighth of what they say. `HYPOTHESIS_PROFILE=random` lets them search,
with all of it: what that finds becomes an `@example` where it was found, so that the verdict on a fresh machine is never
a lottery. `--hypothesis-seed` repeats it.

xdist's own way to group tests writes into node IDs, which newer versions of pytest do not let it.
"""

import atexit
import gc
import os
import re
import shutil
import signal
import sys
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from tests import fmpy_once
from tests.command_line import CommandLine

ROOT = Path(__file__).parent.parent

# what is imported and collected stays: the collector of garbage would look at it again and again, and find nothing
gc.disable()

# tests start many processes, and each would compile all it imports where bytecode is not kept
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# journals of drives: those of tests are no user's
os.environ["TWIN_STATE"] = tempfile.mkdtemp(prefix="twin-state-")
atexit.register(shutil.rmtree, os.environ["TWIN_STATE"], ignore_errors=True)

# a shell's background job ignores Ctrl-C, nohup a closed terminal, and so would the programs that tests start and end
for number, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    if (ignored := getattr(signal, number, None)) and signal.getsignal(ignored) is signal.SIG_IGN:
        signal.signal(ignored, handler)

# output is compared line by line; workers of xdist have COLUMNS=80, and readline, which pytest imports, sets it for
# programs that tests start, unseen by os.environ
os.environ.pop("COLUMNS", None)
os.unsetenv("COLUMNS")

# workers share the cores already: threads of theirs would only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# no deadlines: cores are shared, and the first call of a component compiles it
settings.register_profile("repeatable", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("random", derandomize=False, deadline=None, print_blob=True)
PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "repeatable")
settings.load_profile(PROFILE)

# begun in this order: what compiles the components that others need, then what takes long; the others fill the end
ORDER = (
    "conformance/test_components.py",
    "conformance/test_symbols.py",
    "conformance/test_scenarios.py",
    "test_docs.py",
    "test_house.py",
    "hw_bridge/command/test_command.py",
    "hw_bridge/bridge/test_events.py",
    "hw_bridge/bridge/test_bridge_force.py",
    "fmi/test_export.py",
    "fmi/test_calls.py",
)
BY_CASE = ("conformance/", "test_docs.py")
# made of the same components: what takes seconds to compile is compiled once
ALIKE = {"best_gains": "heart_wall_replay", "contact_force": "heart_wall_replay"}
MULTICAST = (
    "hw_bridge/command/test_command.py",
    "hw_bridge/command/test_control.py",
    "hw_bridge/device/test_module.py",
    "hw_bridge/bridge/test_bridge_processes.py",
    "hw_bridge/test_base_node402_process.py",
    "hw_bridge/bridge/test_three_axes.py",
)


@pytest.fixture(scope="session")
def build() -> Path:
    """The project's own build folder; its cache is by content, so tests and users may share it."""
    return ROOT / "build"


@pytest.fixture(scope="session", autouse=True)
def fmpy_works_once() -> Iterator[None]:
    """See `tests.fmpy_once`."""
    with pytest.MonkeyPatch.context() as patch:
        fmpy_once.install(patch)
        yield


@pytest.fixture(scope="session")
def command_line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CommandLine | None]:
    """Runs commands; None where a process cannot fork."""
    line = CommandLine(ROOT, tmp_path_factory.mktemp("command_line")) if hasattr(os, "fork") else None
    yield line
    if line:
        line.close()


def group(nodeid: str) -> str:
    """What runs on one core: a component, a scenario, a page of the documentation, else a file with its fixtures.

    And all with CAN over multicast: a socket hears every group that anybody on the machine has joined.
    """
    file, _, case = nodeid.partition("::")
    file = file.removeprefix("tests/")
    if file.startswith(BY_CASE):
        name = re.search(r"\[(\w+)[-\]]", case)
        return ALIKE.get(name[1], name[1]) if name else case
    return "multicast" if file in MULTICAST else file


class Groups(LoadScopeScheduling):
    """Groups of tests, one after the other to the next free core."""

    def _split_scope(self, nodeid: str) -> str:
        return group(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Groups:
    config.option.loadscopereorder = False
    return Groups(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order them and mark repetitions as slow; a test with the fixture `multicast` must be in the group of that name."""
    tests_with_a_case: set[str] = set()
    for item in items:
        if item.get_closest_marker("slow_repetitions"):
            test = item.nodeid.partition("[")[0]
            if test in tests_with_a_case:
                item.add_marker(pytest.mark.slow)
            tests_with_a_case.add(test)

        if "multicast" in item.fixturenames and group(item.nodeid) != "multicast":  # type: ignore[attr-defined]
            raise pytest.UsageError(f"{item.nodeid}: uses multicast. Add its file to MULTICAST in tests/conftest.py.")

        if PROFILE == "repeatable":
            draw_less(item)

    def place(item: pytest.Item) -> tuple[int, str]:
        file = item.nodeid.partition("::")[0].removeprefix("tests/")
        return ORDER.index(file) if file in ORDER else len(ORDER), file

    items.sort(key=place)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Every second process reads the files from the end: on a fresh machine each is compiled by one of them only."""
    report = yield
    if isinstance(collector, pytest.Directory) and os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:] in "13579":
        report.result.reverse()
    return report


def draw_less(item: pytest.Item) -> None:
    """An eighth of its examples: what is drawn the same every time finds nothing new."""
    test = getattr(item, "obj", None)
    name = "_hypothesis_internal_use_settings"
    if (own := getattr(test, name, None)) is not None and not hasattr(test, "draws_less"):
        setattr(test, name, settings(own, max_examples=max(own.max_examples // 8, min(own.max_examples, 10))))
        test.draws_less = True  # type: ignore[union-attr]


def pytest_collection_finish() -> None:
    """From here on garbage is looked for, less often than usual: a test makes much, and drops it all."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
