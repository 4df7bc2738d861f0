"""What all pages of a console share: the session, who operates, how a session begins and ends."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

from twin import installed
from twin.console.curves import Curves
from twin.dataclass import dataclass
from twin.errors import TwinError
from twin.live import Live
from twin.web import Seats

if TYPE_CHECKING:
    from twin.live import Catalog

GROUP = (
    "twin.console"  # of entry points: name of a panel -> a function that is given the console and whether one may act
)
OVER = ("stopped", "failed")


@dataclass(frozen=True)
class Panel:
    """A panel of a package above the engine: `fill(console, may)` makes it on the page; `hardware`: only with drives."""

    title: str
    fill: Callable[[Host, Callable[[], bool]], None]
    hardware: bool = False


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
    live: Live | None = None
    seats: Seats = field(default_factory=Seats)
    _source: Curves | None = None
    _stopping: threading.Thread | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, scenario: Path, variant: str | None = None, seed: int | None = None) -> None:
        """Begin a session, after the one before has ended; it gets ready in its own process. TwinError if one goes on."""
        with self._lock:
            if self.live is not None and self.live.state.phase not in OVER:
                raise TwinError("a session goes on. Stop it first.")
            self.close()
            self._stopping = None
            self.scenario, self.variant, self.seed = scenario, variant, seed
            self._source = None
            self.live = Live.start(
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
    def source(self) -> Curves | None:
        """Its signals, for charts."""
        if self.live is None or self.live.catalog is None:
            return None
        if self._source is None or self._source.live is not self.live:
            self._source = Curves(self.live)
        return self._source

    def leave(self) -> None:
        """To the list of scenarios again. TwinError if a session goes on."""
        with self._lock:
            if self.live is not None and self.live.state.phase not in OVER:
                raise TwinError("a session goes on. Stop it first.")
            self.close()
            self.live = self._stopping = None

    def stop(self) -> None:
        """End the session at once, drives by their one stop path; does not wait for the folder."""
        if self.live is not None and self._stopping is None:
            self._stopping = threading.Thread(target=_stopped, args=(self.live,), name="stop")
            self._stopping.start()

    def close(self) -> None:
        """End it and wait for its folder; its signals can be read no more."""
        self.stop()
        if self._stopping is not None and self.live is not None:
            self._stopping.join()
            self.live.close()


def _stopped(live: Live) -> None:
    """Stop; what went wrong is in its state, and on the page."""
    with suppress(TwinError):
        live.stop()


def panels() -> list[Panel]:
    """Panels of packages above the engine."""
    return [installed.load(place) for place in installed.entry_points(GROUP).values()]
