"""What all pages of a console share: the session, who operates, how a session begins and ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from twin import installed
from twin.console.curves import SessionCurves
from twin.errors import TwinError
from twin.live import LiveSession
from twin.web import OperatorLock

if TYPE_CHECKING:
    from twin.live import Catalog

GROUP = (
    "twin.console"  # of entry points: name of a panel -> a function that is given the console and whether one may act
)
OVER = ("stopped", "failed")


class BackgroundActivity(Protocol):
    """What a package above the engine runs beside sessions. What moves there stops where `here` or `hold` stay away."""

    @property
    def busy(self) -> str:
        """Why no session may take the drives now, or nothing."""

    @property
    def attended(self) -> bool:
        """Whether something goes on that a page has to watch."""

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of what can be held."""

    @property
    def held(self) -> Mapping[str, float]:
        """What is held now, as a page is to show it."""

    def hold(self, name: str, at: float, press: int, age: float) -> None:
        """Renew a control that is held, `age` [s] ago, from -1 to 1; `press` is greater at each new press."""

    def here(self, age: float) -> None:
        """The operator's page shows it, and did so `age` [s] ago."""

    def release_hold(self) -> None:
        """Nothing is held any more."""

    def stop(self) -> None:
        """End what goes on at once, by the one stop path; does not wait."""

    def close(self) -> None:
        """The same, and wait for its end."""


@dataclass(frozen=True)
class Panel:
    """A panel of a package above the engine: `fill(console, is_operator)` makes it on the page; `hardware`: only with drives.

    `path`: it has a page of its own. `activity`: what it runs, made once for a console.
    """

    title: str
    fill: Callable[[Host, Callable[[], bool]], None]
    hardware: bool = False
    path: str = ""
    activity: Callable[[Host], BackgroundActivity] | None = None


@dataclass
class Host:
    """One session at a time, in a process of its own. `arm` comes from the command line and from nowhere else."""

    scenario: Path | None = None
    variant: str | None = None
    seed: int | None = None
    overrides: tuple[str, ...] = ()
    hardware: Path | None = None
    arm: bool = False
    rate: float = 1.0
    runs: Path = Path("runs")
    build: Path = Path("build")
    form: str = "fmu"
    live: LiveSession | None = None
    operator_lock: OperatorLock = field(default_factory=OperatorLock)
    activities: dict[str, BackgroundActivity] = field(default_factory=dict)  # by the panel's title
    lock: threading.Lock = field(default_factory=threading.Lock)  # of who takes the drives
    _source: SessionCurves | None = None
    _stopping: threading.Thread | None = None

    def begin(self, scenario: Path, variant: str | None = None, seed: int | None = None) -> None:
        """Begin a session, after the one before has ended; it gets ready in its own process. TwinError if one goes on."""
        with self.lock:
            if self.live is not None and self.live.state.phase not in OVER:
                raise TwinError("a session goes on. Stop it first.")
            self._end()
            self._stopping = None
            self.scenario, self.variant, self.seed = scenario, variant, seed
            self._source = None
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
                form=self.form,
                wait=False,
            )

    @property
    def catalog(self) -> Catalog | None:
        """What the session has; None before it is ready."""
        return self.live.catalog if self.live is not None else None

    @property
    def source(self) -> SessionCurves | None:
        """Its signals, for charts."""
        if self.live is None or self.live.catalog is None:
            return None
        if self._source is None or self._source.live is not self.live:
            self._source = SessionCurves(self.live)
        return self._source

    def leave(self) -> None:
        """To the list of scenarios again. TwinError if a session goes on."""
        with self.lock:
            if self.live is not None and self.live.state.phase not in OVER:
                raise TwinError("a session goes on. Stop it first.")
            self._end()
            self.live = self._stopping = None

    @property
    def drives_in_use(self) -> str:
        """Why nobody beside the session may command the drives now, or nothing. Until it first goes on it has no bus."""
        live = self.live
        if live is None or live.catalog is None or live.state.phase in OVER or not live.catalog.wall_clock:
            return ""
        up = live.state.hardware is not None and live.state.hardware["brought_up"]
        return "the session has the drives. Stop it first." if up or live.state.phase != "paused" else ""

    def resume(self) -> None:
        """Let the session go on; TwinError while something beside it commands its drives."""
        with self.lock:
            live = self.live
            busy = next((activity.busy for activity in self.activities.values() if activity.busy), "")
            if live is not None and busy and live.catalog is not None and live.catalog.wall_clock:
                raise TwinError(busy)
            if live is not None:
                live.resume()

    def release_hold(self) -> None:
        """Nothing is held any more, in the session and beside it."""
        if self.live is not None:
            self.live.release_hold()
        for activity in self.activities.values():
            activity.release_hold()

    def stop(self) -> None:
        """End all that goes on at once, drives by their one stop path; does not wait for the folder."""
        for activity in self.activities.values():
            activity.stop()
        self._stop_session()

    def close(self) -> None:
        """End all and wait for it; signals of the session can be read no more."""
        for activity in self.activities.values():
            activity.close()
        self._end()

    def _stop_session(self) -> None:
        if self.live is not None and self._stopping is None:
            self._stopping = threading.Thread(target=_stop_quietly, args=(self.live,), name="stop")
            self._stopping.start()

    def _end(self) -> None:
        """End the session and wait for its folder."""
        self._stop_session()
        if self._stopping is not None and self.live is not None:
            self._stopping.join()
            self.live.close()


def _stop_quietly(live: LiveSession) -> None:
    """Stop; what went wrong is in its state, and on the page."""
    with suppress(TwinError):
        live.stop()


def panels() -> list[Panel]:
    """Panels of packages above the engine."""
    return [point.load() for point in installed.entry_points(GROUP).values()]
