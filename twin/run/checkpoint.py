"""Checkpoint of a case: the state of its co-simulation in one file, from which another process continues to the bit.

    RUN/checkpoints/0_12500.zip     number of the case, communication steps since its start
        checkpoint.json             format, versions, hashes of the scenario and the members, case, time, loop fields
        members/NAME                serialized state of a member: its FMU state, or its record
        memory/0, memory/1, ...     values that the loop moves between members
        objects.msgpack             connected strings and binaries

`checkpoint.json` is checked before anything is restored. The CRC-32 of the archive finds damaged files. What was recorded
before the checkpoint lies in signals.parquet of the run.
"""

from __future__ import annotations

import hashlib
import io
import json
import platform
import time
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgpack  # type: ignore[import-untyped]

import twin
from twin import clock, compiler
from twin.coupling import RecordMember, SavedState, restore_state, save_state
from twin.errors import TwinError
from twin.files import write_atomically
from twin.revision import checkout

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from twin.coupling import CoSimulation, Member
    from twin.scenario import Case

FOLDER = "checkpoints"
HEADER = "checkpoint.json"
OBJECTS = "objects.msgpack"
FORMAT = 1


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file. `header`: content of checkpoint.json."""

    path: Path
    header: Mapping[str, Any]

    @property
    def case(self) -> tuple[str, int]:
        """Variant and seed."""
        return self.header["variant"], self.header["seed"]

    @property
    def time_ns(self) -> clock.Time:
        """Simulated time [ns]."""
        return clock.from_json(self.header["time_ns"])

    @property
    def met(self) -> tuple[tuple[clock.Time, int], ...]:
        """Time [ns] and index of each condition that was met."""
        return tuple((clock.from_json(time), index) for time, index in self.header["met"])

    @property
    def tick(self) -> int:
        """Communication steps since the start of the case."""
        return int(self.header["fields"]["tick"])

    def read_state(self) -> SavedState:
        """Read the state; TwinError if the file is damaged."""
        try:
            with zipfile.ZipFile(self.path) as archive:
                blocks = tuple(archive.read(f"memory/{number}") for number in range(self.header["blocks"]))
                members = {name: archive.read(f"members/{name}") for name in self.header["members"]}
                objects = msgpack.unpackb(archive.read(OBJECTS))
        except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
            raise damaged(self.path, error) from None
        fields = {
            name: float.fromhex(value) if isinstance(value, str) else value
            for name, value in self.header["fields"].items()
        }
        return SavedState(fields, blocks, members, objects, self.met)


def damaged(path: Path, error: Exception) -> TwinError:
    """Return the error for a file that is no checkpoint."""
    return TwinError(f"{path}: is damaged, or no checkpoint ({error}). Remove it: an earlier checkpoint is used then.")


def read_header(path: Path) -> Checkpoint:
    """Read the header of a checkpoint; TwinError if the file is none, or of another format."""
    try:
        with zipfile.ZipFile(path) as archive:
            header = json.loads(archive.read(HEADER))
            number = header["format"]
    except (OSError, LookupError, ValueError, TypeError, zipfile.BadZipFile) as error:
        raise damaged(path, error) from None
    if number != FORMAT:
        raise TwinError(f"{path}: has format {number}; this version reads {FORMAT}. Use the version that wrote it.")
    return Checkpoint(path, header)


def list_checkpoints(run: Path) -> list[Checkpoint]:
    """Return the checkpoints of a run, the latest last."""
    return sorted(map(read_header, (run / FOLDER).glob("*.zip")), key=lambda checkpoint: checkpoint.time_ns)


def versions() -> dict[str, str]:
    """Return what must be equal to continue to the bit: engine, Python and its libraries as a hash, and the machine's kind."""
    return {"engine": compiler.engine(), "machine": f"{platform.system()} {platform.machine()}"}


def model_hash(member: Member) -> str:
    """Return a hash of a member's model; TwinError if a Python class cannot be compared."""
    if "sha256" in member.identity:
        return member.identity["sha256"]
    if isinstance(member, RecordMember) and (key := compiler.component_fingerprint(type(member.component))):
        return key
    raise TwinError(
        f"{member.name}: cannot be saved in a checkpoint: its class refers to objects whose content cannot be compared. "
        "Keep files, generators and locks out of its module."
    )


@dataclass
class CaseCheckpoints:
    """Checkpoints of a case in progress. `start`: the one that it continues from; None: from its begin.

    `interval_ns`: simulated time between two checkpoints, 0: none are written. `common`: entries that all checkpoints of the run share.
    """

    case: Case
    number: int
    folder: Path
    interval_ns: clock.Time
    start: Checkpoint | None
    common: Mapping[str, Any]
    sync: Callable[[], object]  # returns when all rows until now are in the file of the recording
    hashes: dict[str, str] = field(default_factory=dict)
    begin: float = 0.0  # wall-clock time at which the case was ready to start
    wall_time: float = 0.0  # spent before this process continued the case [s]

    def next_time(self, now: clock.Time) -> clock.Time | None:
        """Return the time of the next checkpoint after `now` [ns]; None if there is none."""
        if not self.interval_ns or now >= self.case.stop_ns:
            return None
        count = (now - self.case.start_ns) // self.interval_ns + 1
        return min(self.case.start_ns + count * self.interval_ns, self.case.stop_ns)

    def identify(self, cosimulation: CoSimulation) -> None:
        """Compute the hashes of the members' models, and compare them with those of the checkpoint to continue from."""
        self.hashes = {name: model_hash(member) for name, member in cosimulation.members.items()}
        self.begin = time.perf_counter()
        if self.start is None:
            return
        saved = self.start.header["members"]
        changed = [name for name in sorted(saved | self.hashes) if saved.get(name) != self.hashes.get(name)]
        if changed:
            raise TwinError(
                f"{self.start.path}: the model of {', '.join(changed)} has changed since. "
                f"Use revision {self.start.header['revision']}, or run the scenario again."
            )

    def restore(self, cosimulation: CoSimulation) -> None:
        """Restore the state of the checkpoint to continue from."""
        assert self.start is not None
        self.wall_time = self.start.header["wall_time"]
        restore_state(cosimulation, self.start.read_state())

    def write(self, cosimulation: CoSimulation) -> None:
        """Write a checkpoint at the communication point reached."""
        self.sync()
        state = save_state(cosimulation)
        header = {
            "format": FORMAT,
            **self.common,
            "variant": self.case.variant,
            "seed": self.case.seed,
            "time": clock.text(cosimulation.time),
            "time_ns": clock.to_json(cosimulation.time),
            "wall_time": self.wall_time + time.perf_counter() - self.begin,
            "interval_ns": clock.to_json(self.interval_ns),
            "members": self.hashes,
            "blocks": len(state.blocks),
            "met": [(clock.to_json(time_ns), index) for time_ns, index in state.met],
            "fields": {name: v.hex() if isinstance(v, float) else v for name, v in state.fields.items()},
        }
        entries = {
            HEADER: json.dumps(header, indent=1).encode(),
            **{f"members/{name}": data for name, data in state.members.items()},
            **{f"memory/{number}": block for number, block in enumerate(state.blocks)},
            OBJECTS: msgpack.packb(state.objects),
        }
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, content in entries.items():
                archive.writestr(name, content)
        write_atomically(self.folder / FOLDER / f"{self.number}_{state.fields['tick']}.zip", data.getvalue())


def common_header(run: Path, cases: Sequence[tuple[str, int]], backend: str) -> dict[str, Any]:
    """Return the entries that all checkpoints of a run share."""
    return {
        "version": twin.__version__,
        "revision": checkout(Path(twin.__file__).parent) or twin.__version__,
        "versions": versions(),
        "scenario_sha256": scenario_hash(run),
        "cases": cases,
        "backend": backend,
    }


def scenario_hash(run: Path) -> str:
    """Return the hash of a run's frozen scenario."""
    return hashlib.sha256((run / "scenario.yaml").read_bytes()).hexdigest()
