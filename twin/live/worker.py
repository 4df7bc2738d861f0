"""Process of a session: `python -m twin.live.worker FD`, started by `LiveSession`; FD is its end of a socket pair."""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
import threading
import time
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from twin import clock
from twin.errors import TwinError, described
from twin.live.catalog_builder import recorded_names, spaces_of
from twin.live.channel import Channel, ClosedError
from twin.live.operator.operation_log import event_lines, time_text
from twin.live.pacing import checked_rate
from twin.live.session import Session
from twin.run import Hardware, RunCallbacks, RunOptions, load_hardware, resolve_catalogs, run_scenario
from twin.scenario import Backend, controls_of, criteria_yaml, load_scenario, parse_scenario, single_case_yaml

if TYPE_CHECKING:
    from twin.live.session import Drives
    from twin.scenario import Case, ScenarioSpec

NOTICE_TIME = 0.1  # time within which a loop with short steps notices the closed channel by itself [s]
MAX_DURATION = 1_000_000 * clock.NANOSECONDS  # of a session [ns]; the operator ends it earlier


class SessionProcess:
    """Runs sessions one after another until the channel is closed or no reset is requested."""

    def __init__(self, channel: Channel, job: dict[str, Any]) -> None:
        self.channel, self.job = channel, job
        self.session = Session(channel, checked_rate(job["rate"]), job["running"])
        self.session.first_values = job.get("values", {})
        self.hardware: Hardware | None = None
        self.said = ""

    def prepare(self) -> ScenarioSpec:
        """Return the scenario of the session: one variant with one seed, with all visible signals recorded."""
        job, session = self.job, self.session
        self.progress("reading the scenario", 0.0)
        scenario = load_scenario(job["scenario"], job["overrides"])
        variant = job["variant"] or scenario.variants[0].variant
        seeds = scenario.seeds[0] if job["seed"] is None else job["seed"]
        case = scenario.cases([variant], [seeds])[0]
        variables = resolve_catalogs(scenario)[variant]
        spaces = [scene.space.names for scene in spaces_of(scenario, variant, variables) if scene.space is not None]
        names = recorded_names(case, variables, (*job["record"], *dict.fromkeys(chain(*spaces))))
        if job["hardware"]:
            self.hardware = load_hardware(Path(job["hardware"]), job["arm"], Path(job["build"]))
            session.drives = cast("Drives", self.hardware)
            drive_variables = resolve_catalogs(self.hardware.apply(scenario))[
                variant
            ]  # a drive lacks the local variables of the member it replaces
            names = [name for name in names if name.partition(".")[2] in drive_variables[name.partition(".")[0]]]
        session.scenario, session.variant, session.head = scenario, variant, single_case_yaml(scenario, case, names)
        criteria = criteria_yaml(scenario, case, names, has_end=not controls_of(scenario, case, variables))
        own = endless(session.head, case, scenario.path, criteria, is_limited="valid_until" in scenario.tree.entries)
        session.session_scenario = own
        return own

    def run(self) -> None:
        """Run sessions until one ends without a reset."""
        job, session = self.job, self.session
        own = self.prepare()
        options = RunOptions(
            backend=Backend(job["backend"]), root=Path(job["runs"]), build=Path(job["build"]), report=job["report"]
        )
        callbacks = RunCallbacks(
            progress=self.progress,
            run_case=session.course,
            operator_changes=session.operator_changes,
            early_end=session.early_end,
            paused_time=lambda: session.paused_time,
        )
        self.progress("loading the members", 0.0)
        while True:
            outcome = run_scenario(own, options, hardware=self.hardware, callbacks=callbacks)
            if session.drives is not None and not session.gone:
                session.send(hardware=session.drive_status(session.drives))  # after the stop sequence
            failed = outcome.run.status == "failed"  # not merely ended early by its operator
            if session.gone or not (session.again or (failed and self.wait_for_reset())):
                return

    def wait_for_reset(self) -> bool:
        """Wait after a failure for a reset (True) or a stop (False)."""
        self.session.enter("failed")
        while True:
            for message in self.channel.receive(None):
                more = message.get("ask") == "reset" and not self.session.wall_clock
                if more or message.get("ask") == "stop":
                    self.session.enter("starting" if more else "finishing")
                    self.session.send(answer=message.get("number"))
                    self.session.running = False
                    return more
                if message.get("number") is not None:
                    self.session.send(answer=message["number"], refused="the simulation has failed. Reset it.")

    def progress(self, name: str, part: float) -> None:
        """Send what is done before the first step and after the last, each once, with the percentage that is written."""
        text = f"{name}, {part:.0%}" if self.session.phase == "finishing" and part < 1.0 else name
        if self.session.phase in ("starting", "finishing") and text != self.said:
            self.said = text
            self.session.send(progress=text)


def endless(head: str, case: Case, path: Path, criteria: str = "", is_limited: bool = False) -> ScenarioSpec:
    """Return the scenario of a session without an end, with the events of its case.

    `criteria`: YAML of metrics and expectations. `is_limited`: valid until its end only.
    """
    end = case.stop_ns if is_limited else case.start_ns + MAX_DURATION // case.step_ns * case.step_ns
    own = parse_scenario(f"stop_time: {time_text(end)}\n{head}{criteria}", path)
    only = replace(own.variants[0], events=case.events, faults=case.faults, conditions=case.conditions)
    text = f"stop_time: {time_text(case.stop_ns)}\n{head}{criteria}events:\n{event_lines((*case.conditions, *case.events))}"
    return replace(own, variants=(only,), text=text)


def watch_peer(end: socket.socket) -> None:
    """Wait until the peer closes the socket; then send SIGTERM to this process unless its loop has noticed and ended it."""
    gone = select.poll()
    gone.register(end, getattr(select, "POLLRDHUP", 0) | select.POLLHUP)  # POLLRDHUP exists on Linux only
    gone.poll()
    time.sleep(NOTICE_TIME)
    os.kill(os.getpid(), signal.SIGTERM)


def main() -> None:
    """Serve the end of a socket pair that the first argument names."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The parent process ends this one.
    end = socket.socket(fileno=int(sys.argv[1]))
    channel = Channel(end)
    threading.Thread(target=watch_peer, args=[end], name="watch peer", daemon=True).start()
    try:
        job = next(iter(channel.receive(None)))
        try:
            SessionProcess(channel, job).run()
        except TwinError as error:
            channel.send(failed=error.problems)
        except ClosedError:
            raise
        except Exception as error:
            channel.send(failed=[described(error)])
            raise
    except ClosedError:
        pass


if __name__ == "__main__":
    main()
