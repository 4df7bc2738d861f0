"""State shared by the pages of a console: the session, the operator, begin and end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

from twin import installed
from twin.console.curves import SessionCurves
from twin.errors import TwinError
from twin.live import OVER, LiveSession
from twin.web import OperatorLock

if TYPE_CHECKING:
    from twin.live import Catalog

GROUP = "twin.console"  # entry points: name of a panel -> `Panel`


class BackgroundActivity(Protocol):
    """An activity of a package above the engine, outside of sessions. Its motion stops without `here` or `hold`."""

    @property
    def busy(self) -> str:
        """Why no session may use the drives now, or nothing."""

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the controls."""

    @property
    def held(self) -> Mapping[str, float]:
        """Held controls, for display."""

    def hold(self, name: str, at: float, press: int, age: float) -> None:
        """Renew a hold, `age` [s] ago, at -1 to 1; `press` increases with each new press."""

    def here(self, age: float) -> None:
        """Renew the presence of the operator's page, `age` [s] ago."""

    def release_hold(self) -> None:
        """Release all holds."""

    def release_drives(self) -> None:
        """End everything that only reads the drives, and wait."""

    def stop(self) -> None:
        """End the activity at once by the stop sequence; does not wait."""

    def close(self) -> None:
        """End the activity and wait."""


@dataclass(frozen=True)
class Panel:
    """A panel of a package above the engine, created by `fill(console, is_operator)`; `hardware`: only with drives.

    `path`: the panel has its own page. `activity`: created once per console.
    """

    title: str
    fill: Callable[[Host, Callable[[], bool]], None]
    hardware: bool = False
    path: str = ""
    activity: Callable[[Host], BackgroundActivity] | None = None


@dataclass(frozen=True)
class RunMetrics:
    """Metrics of a run [SI] by name. `run`: its identity; `title`: variant, whether values were changed by hand, time of day.

    `folder`: of its results. `source`: scenario with the hash of its file.
    """

    run: Any = None
    values: Mapping[str, float] = field(default_factory=dict)
    title: str = ""
    folder: str = ""
    source: tuple[Path, int] | None = None


@dataclass
class Host:
    """The console: one session at a time, in its own process. `arm` comes from the command line only."""

    scenario: Path | None = None
    variant: str | None = None
    seed: int | None = None
    overrides: tuple[str, ...] = ()
    hardware: Path | None = None
    arm: bool = False
    rate: float = 1.0
    runs: Path = Path("runs")
    build: Path = Path("build")
    backend: str = "fmu"
    live: LiveSession | None = None
    operator_lock: OperatorLock = field(default_factory=OperatorLock)
    activities: dict[str, BackgroundActivity] = field(default_factory=dict)  # by title of the panel
    lock: threading.Lock = field(default_factory=threading.Lock)  # of the use of the drives
    latest_metrics: RunMetrics = RunMetrics()  # of the shown run
    before: RunMetrics = RunMetrics()  # of the last run that had some
    _source: SessionCurves | None = None
    _stopping: threading.Thread | None = None

    def begin(
        self,
        scenario: Path,
        variant: str | None = None,
        seed: int | None = None,
        values: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Start a session after the previous one has ended; it prepares in its own process. TwinError if one is running."""
        with self.lock:
            if self.is_open:
                raise TwinError("a session is running. Stop it first.")
            self._end()
            for activity in self.activities.values():
                activity.release_drives()
            self._stopping = None
            if scenario != self.scenario:
                self._source = None
                self.overrides = self.overrides if self.scenario is None else ()  # they are of the command's scenario
            self.scenario, self.variant, self.seed = scenario, variant, seed
            self.live = LiveSession.start(
                scenario,
                variant=variant,
                seed=seed,
                overrides=self.overrides,
                rate=self.rate,
                hardware=self.hardware,
                arm=self.arm,
                runs=self.runs,
                build=self.build,
                backend=self.backend,
                report=True,
                values=values,
                wait=False,
            )

    def restart(self, variant: str | None, nominal: bool = False) -> None:
        """End the session and start a variant of the same scenario, with the values that the operator has set unless `nominal`.

        TwinError with drives, which only an operator stops.
        """
        if self.hardware is not None and self.is_open:
            raise TwinError("a session with drives is running. Stop it first.")
        if self.scenario is not None:
            values = {} if nominal or self.live is None else self.live.changed_values
            self._stop_session()
            if self._stopping is not None:
                self._stopping.join()
            self.begin(self.scenario, variant, self.seed, values)

    def reset(self, nominal: bool = False) -> None:
        """Begin the session again, with the values that the operator has set unless `nominal`."""
        if self.live is not None:
            self.live.reset({} if nominal else self.live.changed_values)

    @property
    def is_open(self) -> bool:
        """Whether a session is being prepared, runs or is paused."""
        return self.live is not None and self.live.state.phase not in OVER

    @property
    def catalog(self) -> Catalog | None:
        """The catalog of the session; None before it is ready."""
        return self.live.catalog if self.live is not None else None

    @property
    def has_ended(self) -> bool:
        """Whether the session is over, or pauses at the end of a scenario without controls."""
        if self.live is None or self.live.catalog is None:
            return False
        state, catalog = self.live.state, self.live.catalog
        is_at_end = state.phase == "paused" and state.time >= catalog.stop > 0.0 and not catalog.controls
        return is_at_end or state.phase in OVER

    @property
    def source(self) -> SessionCurves | None:
        """The source of the charts."""
        if self.live is None or self.live.catalog is None:
            return None
        if self._source is None or (self._source.live, self._source.epoch) != (self.live, self.live.state.epoch):
            self._source = SessionCurves(self.live, self._source)
        return self._source

    @property
    def stop_label(self) -> str:
        """Text of the button that ends everything: STOP where drives or a rig under controls may move; empty if nothing runs."""
        if self.hardware is not None:
            return "STOP"
        if self.live is None or not self.is_open or self.live.state.phase == "finishing":
            return ""  # the results are written: nothing moves
        return "STOP" if self.live.catalog is not None and self.live.catalog.controls else "End"

    def metrics_before(self, run: Any) -> RunMetrics:
        """Return the metrics of the run of the same scenario before this one; `run`: identity of this one."""
        if self.latest_metrics.run != run:
            self.before = self.latest_metrics if self.latest_metrics.values else self.before
            path = self.scenario
            source = (path, hash(path.read_bytes())) if path is not None and path.is_file() else None
            self.latest_metrics = RunMetrics(run, source=source)
        return self.before if self.before.source == self.latest_metrics.source else RunMetrics()

    def leave(self) -> None:
        """Return to the list of scenarios. TwinError if a session is running."""
        with self.lock:
            if self.is_open:
                raise TwinError("a session is running. Stop it first.")
            self._end()
            self.live = self._stopping = self._source = None
            self.latest_metrics = self.before = RunMetrics()

    @property
    def drives_in_use(self) -> str:
        """Why nothing outside of the session may use the drives, or nothing. Before its first step it has no bus."""
        live = self.live
        if live is None or live.catalog is None or live.state.phase in OVER or not live.catalog.wall_clock:
            return ""
        up = live.state.hardware is not None and live.state.hardware["brought_up"]
        return "the session uses the drives. Stop it first." if up or live.state.phase != "paused" else ""

    def resume(self) -> None:
        """Continue the session; TwinError while an activity uses its drives."""
        with self.lock:
            live = self.live
            busy = next((activity.busy for activity in self.activities.values() if activity.busy), "")
            if live is not None and busy and live.catalog is not None and live.catalog.wall_clock:
                raise TwinError(busy)
            if live is not None:
                live.resume()

    def release_hold(self) -> None:
        """Release all holds, of the session and of activities."""
        if self.live is not None:
            self.live.release_hold()
        for activity in self.activities.values():
            activity.release_hold()

    def stop(self) -> None:
        """End everything at once, drives by their stop sequence; does not wait for the results."""
        for activity in self.activities.values():
            activity.stop()
        self._stop_session()

    def close(self) -> None:
        """End everything and wait; signals of the session are no longer readable."""
        for activity in self.activities.values():
            activity.close()
        self._end()

    def _stop_session(self) -> None:
        if self.live is not None and self._stopping is None:
            self._stopping = threading.Thread(target=_stop_quietly, args=(self.live,), name="stop")
            self._stopping.start()

    def _end(self) -> None:
        self._stop_session()
        if self._stopping is not None and self.live is not None:
            self._stopping.join()
            self.live.close()


def _stop_quietly(live: LiveSession) -> None:
    """Stop; an error is in the state of the session."""
    with suppress(TwinError):
        live.stop()


def panels() -> list[Panel]:
    """Return the panels of packages above the engine."""
    return [point.load() for point in installed.entry_points(GROUP).values()]
