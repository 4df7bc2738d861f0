"""What an FMU says of itself: read from its archive alone, so of any platform; nothing is unpacked or loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from twin import clock
from twin.errors import FMUError
from twin.fmi import archive, xml_checks
from twin.fmi.importing.unpacked import digest
from twin.fmi.variables import variables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.coupling import MemberVariable
    from twin.fmi.clocks.clock_declarations import Clock


@dataclass(frozen=True)
class Outline:
    """`about`: its own description; `interfaces` in words; `platforms`: folders of its libraries, `C sources` if it has them."""

    fmi: str
    name: str
    about: str
    generator: str
    interfaces: tuple[str, ...]
    platforms: tuple[str, ...]
    variables: Mapping[str, MemberVariable]
    clocks: Mapping[str, Clock]

    def kind(self, name: str) -> str:
        """What kind of clock a variable is, for people; empty if it is none."""
        declared = self.clocks.get(name)
        if declared is None:
            return ""
        every = f" of {clock.text(declared.interval)}" if declared.interval is not None else ""
        after = f", first after {clock.text(declared.shift)}" if declared.shift else ""
        return f"clock, {declared.variability}{every}{after}"


def outline(path: str | Path) -> Outline:
    """Read an FMU's description; a one-line FMUError if the file is no FMU or invalid."""
    path = Path(path)
    digest(path)
    try:
        with path.open("rb") as file, archive.open_archive(path, file) as opened:
            entries = archive.check_entries(path, opened)
            description = archive.read_description(path, opened, entries, "")
        model = archive.described(path, description)
        return Outline(
            description.fmi.number,
            description.tree.get("modelName", ""),
            description.tree.get("description", ""),
            model.generator,
            tuple(text for tag, text in xml_checks.INTERFACES.items() if description.tree.find(tag) is not None),
            platforms(entries),
            variables(model, description.fmi, str(path), {}, {}),
            {clock.name: clock for clock in model.clocks.every},
        )
    except FMUError:
        raise
    except Exception as error:  # damaged archives make zipfile raise nearly anything
        raise FMUError(f"{path}: cannot be read ({xml_checks.error_line(error)}). Get or build it once more.") from None


def platforms(entries: Mapping[str, object]) -> tuple[str, ...]:
    """Where its libraries run, as its folders say."""
    folders = archive.platform_folders(entries)
    return (*folders, "C sources") if any(name.startswith("sources/") for name in entries) else tuple(folders)
