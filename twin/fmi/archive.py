"""The archive of an FMU: checked before anything is written, unpacked into a folder of its own, described.

Nothing of an archive is trusted: neither its file names, nor the sizes it claims, nor its XML. Every defect is one
`FMUError`, and the folder is gone when `close` has been called, at the latest when the process ends.
"""

from __future__ import annotations

import re
import shutil
import stat
import tempfile
import zipfile
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from twin import compiler
from twin.errors import FMUError
from twin.fmi import model_description, terminals, xml_checks
from twin.fmi.fmi_version import FMI3
from twin.fmi.importing import fmi1, foreign_sources
from twin.fmi.importing.unpacked import Unpacked, digest, suffix
from twin.process import PREFIX, process_identity, temporary_folder_for

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import IO

FILES = 20_000  # largest number of entries; each takes up to a millisecond to write and to remove
TOTAL = 2 << 30  # largest size of everything [byte]
DESCRIPTION = 64 << 20  # largest modelDescription.xml [byte]
HARMLESS = 256 << 20  # below this size [byte] no compression ratio is suspicious
RATIO = 200  # largest ratio of size to archive beyond that; deflate can reach 1030
CHUNK = 1 << 20
METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}  # the two that FMI allows
# FMPy and the FMU manipulation toolbox put it beside a library of another platform, for their own to talk to
SERVER = re.compile(r"binaries/[^/]+/server_(tcp|sm)(\.exe)?")


def unpack(path: str | Path, interface: str = "") -> Unpacked:
    """Check an FMU, then unpack it into a temporary folder and read its description."""
    path = Path(path)
    sha256 = digest(path)
    temporary: tempfile.TemporaryDirectory[str] | None = None
    try:
        with path.open("rb") as file, open_archive(path, file) as archive:
            entries = check_entries(path, archive)
            description = read_description(path, archive, entries, interface)
            binary, sources = find_binary(path, description, entries), {}
            if binary not in entries:
                sources = read_sources(archive, entries)
            plugs = entries.get(terminals.ARCHIVE_PATH) if description.fmi == FMI3 else None
            shown = document(path, archive, plugs) if plugs is not None else b""

            # the folder is canonical: a library's own idea of its path must not differ
            files = needed(entries, binary)
            parent_folder = temporary_folder_for(sum(info.file_size for info in files.values()))
            temporary = tempfile.TemporaryDirectory(
                prefix=f"{PREFIX}{process_identity()}-fmu-", dir=parent_folder, ignore_cleanup_errors=True
            )
            root = Path(temporary.name).resolve()
            extract(path, archive, files, root / "fmu")
        (root / "fmu" / "resources").mkdir(exist_ok=True)
        parsed = described(path, description)
        notes = ["needs the tool it was made with on this machine"] if description.needs_tool else []
        if sources:
            notes.append("has no library for this machine: its C sources were compiled")
            write_library(root / "fmu" / binary, foreign_sources.build_sources(path, description, sources))
        if description.is_fmi1:
            notes.append(fmi1.NOTE)
            folder, _, name = binary.rpartition("/")
            binary = f"{folder}/{fmi1.WRAPPER_PREFIX}{name}"
            write_library(root / "fmu" / binary, foreign_sources.build_wrapper())
        terminal_members, left_out = terminals.read(path, shown, {variable.name for variable in parsed.variables})
        return Unpacked(
            path,
            root / "fmu",
            parsed,
            description.fmi,
            description.interface,
            root / "fmu" / binary,
            sha256,
            notes + left_out,
            temporary,
            terminals=terminal_members,
        )
    except BaseException as error:
        if temporary is not None:
            temporary.cleanup()
        if isinstance(error, FMUError) or not isinstance(error, Exception):
            raise
        # damaged archives make zipfile raise nearly anything: zlib.error, struct.error, EOFError, OverflowError, ...
        raise FMUError(
            f"{path}: cannot be unpacked ({xml_checks.error_line(error)}). Get or build it once more."
        ) from None


def open_archive(path: Path, file: IO[bytes]) -> zipfile.ZipFile:
    """Open the archive; FMUError names the actual file type."""
    try:
        return zipfile.ZipFile(file)
    except zipfile.BadZipFile as error:
        raise FMUError(f"{path}: is not a zip archive, or cut off ({error}). Get or build it once more.") from None


def check_entries(path: Path, archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Names and sizes of the files, by normalized path; everything that could write elsewhere is refused."""
    infos = archive.infolist()
    if len(infos) > FILES:
        raise FMUError(f"{path}: has {len(infos)} files, more than {FILES}. Put its resources into one archive.")
    entries: dict[str, zipfile.ZipInfo] = {}
    names_by_key: dict[str, str] = {}
    repeated = 0  # size of what is there once more [byte]
    for info in infos:
        name = checked_name(path, info)
        if info.flag_bits & 0x1:
            raise FMUError(f"{path}: {name!r} is encrypted. Export the FMU without a password.")
        if info.compress_type not in METHODS:
            raise FMUError(f"{path}: {name!r} is compressed in another way than deflate, the only one that FMI allows.")
        mode = stat.S_IFMT(info.external_attr >> 16)
        if mode not in (0, stat.S_IFREG, stat.S_IFDIR):
            kind = "a symbolic link" if mode == stat.S_IFLNK else "not a plain file"
            raise FMUError(f"{path}: {name!r} is {kind}. An FMU holds plain files only.")
        if info.is_dir():
            continue
        repeated += info.file_size * (name in entries)
        if name in entries and repeated <= HARMLESS and is_same(archive, entries[name], info):
            continue  # some tools add a file twice
        if name.casefold() in names_by_key:
            raise FMUError(
                f"{path}: {name!r} and {names_by_key[name.casefold()]!r} are the same file. Remove one of them."
            )
        names_by_key[name.casefold()] = name
        entries[name] = info
    claimed = sum(info.file_size for info in entries.values())
    if claimed > TOTAL:
        raise FMUError(f"{path}: unpacks to {claimed >> 20} MiB, more than {TOTAL >> 20} MiB. This is not an FMU.")
    return entries


def is_same(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, other: zipfile.ZipInfo) -> bool:
    """Whether two entries have the same content; checksums can be made to agree, so it is read."""
    if (entry.CRC, entry.file_size) != (other.CRC, other.file_size):
        return False
    with archive.open(entry) as first, archive.open(other) as second:
        while (chunk := first.read(CHUNK)) == second.read(CHUNK):
            if not chunk:
                return True
    return False


def checked_name(path: Path, info: zipfile.ZipInfo) -> str:
    """The entry's path inside the FMU's folder, without `.` and doubled slashes."""
    raw = info.orig_filename
    parts = PurePosixPath(raw).parts
    wrong = ""
    if "\\" in raw:
        wrong = "has a backslash"
    elif ":" in raw:
        wrong = "has a drive letter or a colon"
    elif raw.startswith("/"):
        wrong = "is an absolute path"
    elif ".." in parts:
        wrong = "leads out of its folder"
    elif any(ord(letter) < 32 or ord(letter) == 127 for letter in raw):
        wrong = "has control characters"
    elif not parts and not info.is_dir():
        wrong = "is empty"
    if wrong:
        raise FMUError(f"{path}: the file name {raw!r} {wrong}. An FMU holds relative paths with forward slashes only.")
    return str(PurePosixPath(*parts))


def read_description(
    path: Path, archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo], interface: str
) -> xml_checks.Description:
    """modelDescription.xml, parsed safely and checked for what a run needs."""
    info = entries.get("modelDescription.xml")
    if info is None:
        inner = next((name for name in entries if name.endswith("/modelDescription.xml")), None)
        hint = f"It is in {inner!r}: zip the content of that folder" if inner else "This is not an FMU"
        raise FMUError(f"{path}: has no modelDescription.xml at its top. {hint}.")
    return xml_checks.check(path, document(path, archive, info), interface)


def described(path: Path, description: xml_checks.Description) -> model_description.ModelDescription:
    """What it says; FMUError if that makes no sense."""
    try:
        return model_description.read(description.fmi, description.tree, description.interface)
    except ValueError as error:
        reason = xml_checks.error_line(error)
        raise FMUError(f"{path}: modelDescription.xml cannot be read ({reason}). Export the FMU once more.") from None


def document(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    """An XML file, if it is not suspiciously large."""
    with archive.open(info) as file:
        content = file.read(DESCRIPTION + 1)
    if len(content) > DESCRIPTION:
        raise FMUError(f"{path}: {info.filename} is larger than {DESCRIPTION >> 20} MiB. This is not an FMU.")
    return content


def find_binary(path: Path, description: xml_checks.Description, entries: dict[str, zipfile.ZipInfo]) -> str:
    """The library for this platform; it may have to be compiled of sources. Without them an error with the platforms."""
    platform = compiler.host()
    folder = description.fmi.platform_folder(platform)
    binary = f"binaries/{folder}/{description.identifier}{suffix(platform)}"
    if binary in entries:
        return binary
    others = platform_folders(entries)
    if folder in others:
        raise FMUError(f"{path}: {binary} is missing. The library must be named like modelIdentifier.")
    if not description.is_fmi1 and any(name.startswith("sources/") for name in entries):
        return binary
    has = f"only {', '.join(others)}" if others else "no binaries"
    raise FMUError(f"{path}: has {has}, none for {folder}. Export it for this platform.")


def platform_folders(entries: Iterable[str]) -> list[str]:
    """Folders of libraries, by platform."""
    return sorted({matched[1] for name in entries if (matched := re.fullmatch(r"binaries/([^/]+)/[^/]+", name))})


def read_sources(archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo]) -> dict[str, bytes]:
    """Files below `sources/` by their path in it."""
    return {
        name.removeprefix("sources/"): archive.read(info)
        for name, info in entries.items()
        if name.startswith("sources/") and info.file_size <= DESCRIPTION
    }


def write_library(path: Path, content: bytes) -> None:
    """Write a library that was compiled here."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def needed(entries: dict[str, zipfile.ZipInfo], binary: str) -> dict[str, zipfile.ZipInfo]:
    """What a run needs: neither sources and documentation nor other platforms' libraries, unless a server loads them."""
    served = [f"{name.rpartition('/')[0]}/" for name in entries if SERVER.fullmatch(name)]
    own = (f"{binary.rpartition('/')[0]}/", *served)
    return {
        name: info
        for name, info in entries.items()
        if not name.startswith(("binaries/", "sources/", "documentation/")) or name.startswith(own)
    }


def extract(path: Path, archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo], folder: Path) -> None:
    """Write the files, counting the bytes unpacked: the sizes declared in the archive are not trusted."""
    total = 0
    allowed = min(TOTAL, max(HARMLESS, RATIO * path.stat().st_size))
    if shutil.disk_usage(folder.parent).free < sum(info.file_size for info in entries.values()):
        raise FMUError(f"{path}: does not fit on the disk of {folder.parent}. Free some space, or set TMPDIR.")
    folder.mkdir()
    for name, info in entries.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(info) as source, target.open("xb") as copy:
            while chunk := source.read(CHUNK):
                total += len(chunk)
                if total > allowed:
                    raise FMUError(f"{path}: unpacks to more than {allowed >> 20} MiB. This is not an FMU.")
                copy.write(chunk)
        if SERVER.fullmatch(name):
            target.chmod(0o700)  # it is started, not loaded
