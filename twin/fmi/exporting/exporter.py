"""Export of a component as an FMU: native code, description, documentation, one reproducible archive.

The component's C of `twin.compiler`, the state machine in `c/`, compiled once for all components, and a generated
`model.c` become a library that needs libm and nothing else. Two exports are equal to the byte.
"""

from __future__ import annotations

import hashlib
import inspect
import io
import uuid
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import twin
from twin import compiler, installed
from twin.compiler import model_name, tangents
from twin.component import Component, Role, source
from twin.errors import BuildError
from twin.files import write_atomically
from twin.fmi import terminals
from twin.fmi.exporting import model_description_writer
from twin.fmi.exporting.fmu_cache import build, is_built, readme, refuse_python_side
from twin.fmi.exporting.model_c_writer import model_c, source_code
from twin.fmi.exporting.model_description_writer import Exposed
from twin.fmi.exporting.sources import FOLDER, listed, source_files, to_compile
from twin.fmi.fmi_version import FMI2, FMI3
from twin.revision import revision

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

__all__ = ["VERSIONS", "build", "export", "is_built", "made", "plan"]


ENGINE = Path(__file__).parents[2]


# after what holds for components: a call must not become one of memcpy, and nothing gains from being unrolled
STATE_MACHINE = ("-O2", "-fno-builtin")
TABLE = ("-O1", "-fno-builtin")


@dataclass(frozen=True, slots=True)
class Version:
    """What differs between the versions of FMI: words, not steps."""

    source: str
    expose: Callable[[type[Component]], list[Exposed]]
    describe: Callable[..., bytes]
    folder: Callable[[str], str]
    has_time: bool
    more: Callable[[type[Component]], dict[str, bytes]]


VERSIONS = {
    "2.0": Version(
        "fmi2.c",
        model_description_writer.expose_scalars,
        model_description_writer.describe_2,
        FMI2.platform_folder,
        False,
        terminals.none,
    ),
    "3.0": Version(
        "fmi3.c",
        model_description_writer.expose_arrays,
        model_description_writer.describe_3,
        FMI3.platform_folder,
        True,
        terminals.files,
    ),
}


# ------------------------------------------------------------------------------------------------- compile and link


def state_machine(platform: str, name: str, build: Path) -> bytes:
    """Object file of `fmi2.c` or `fmi3.c`, the same for all components: compiled once for a platform."""
    texts = {file.name: file.read_text(encoding="utf-8") for file in sorted(FOLDER.iterdir())}
    return compiler.compile_c(texts.pop(name), platform, build, headers=texts, options=STATE_MACHINE, name=name)


def library(made: ExportPlan, source: str, own: compiler.Sources, platform: str, build: Path) -> bytes:
    """The shared library of an FMU for a platform: state machine, table, component."""
    headers = {"model.h": (FOLDER / "model.h").read_text(encoding="utf-8"), f"{own.name}.h": own.header}
    table = compiler.compile_c(made.model, platform, build, headers=headers, options=TABLE, name="model.c")
    component = compiler.compile_sources(own, platform, build)
    # last: the first thread to get here compiles it for all, and the others still have work
    return compiler.link(platform, [state_machine(platform, source, build), table, component], build)


# ----------------------------------------------------------------------------------------------------- documentation


@cache
def _page() -> Any:
    """The template of the documentation, compiled once."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(ENGINE / "fmi" / "exporting"), autoescape=True, trim_blocks=True
    )
    return environment.get_template("documentation.html")


def documentation(cls: type[Component], version: str) -> str:
    """`documentation/index.html`: docstring, README, variables with units, starts and sources."""
    import markdown_it

    markdown = markdown_it.MarkdownIt("commonmark", {"html": False}).enable("table")
    groups = [(role, [v for v in cls.variables if v.role is role]) for role in Role if role is not Role.derivative]
    page: str = _page().render(
        name=model_name(cls),
        version=version,
        summary=model_description_writer.summary(cls),
        docstring=inspect.cleandoc(cls.__doc__ or "").partition("\n")[2].strip(),
        readme=markdown.render(readme(cls)),
        groups=groups,
        period=cls.period,
        text=_start_text,
        terminals=cls.terminals,
        exchange=model_description_writer.offers_exchange(cls),
        derivable=model_description_writer.offers_derivatives(cls),
        underivable=underivable(cls),
    )
    return page


def underivable(cls: type[Component]) -> str:
    """Why a continuous component offers no directional derivatives; empty if it does, or is not continuous."""
    analysis = tangents(cls)
    return analysis if model_description_writer.is_continuous(cls) and isinstance(analysis, str) else ""


def _start_text(variable: Any) -> str:
    values = variable.start_array().reshape(-1).tolist()
    if all(value == values[0] for value in values):
        return model_description_writer.text(values[0])
    return " ".join(map(model_description_writer.text, values[:8])) + (" ..." if len(values) > 8 else "")


# ------------------------------------------------------------------------------------------------------------ archive


@dataclass(frozen=True, slots=True)
class ExportPlan:
    """All of an FMU but its binaries, and the token that stands for its content."""

    name: str
    token: str
    model: str  # model.c
    files: dict[str, bytes]


def check_clock(cls: type[Component], version: str) -> None:
    """Raise BuildError unless an FMU can have the component's sample period as a clock."""
    if version != "3.0":
        raise BuildError(f"FMI {version} has no clocks. Export for FMI 3.0, or without a clock.")
    if not cls.period_ns:
        raise BuildError(f"{cls.__name__}: is not sampled, so it has no clock. Export it without a clock.")


def plan(
    cls: type[Component], version: str, own: compiler.Sources | None = None, *, has_clock: bool = False
) -> ExportPlan:
    """What an export contains. `own`: the component's C, if it was translated already; `has_clock`: as of `export`."""
    refuse_python_side(cls)
    if version not in VERSIONS:
        raise BuildError(f"FMI version {version!r} is not offered. Use one of {', '.join(VERSIONS)}.")
    words, name = VERSIONS[version], model_name(cls)
    exposed, describe = words.expose(cls), words.describe
    if has_clock:
        check_clock(cls, version)
        describe = partial(describe, has_clock=True)
    more = {"documentation/index.html": documentation(cls, version).encode(), **words.more(cls)}
    blank_token = f"{{{uuid.UUID(int=0)}}}"
    digest = hashlib.sha256(describe(cls, name, blank_token, exposed) + b"".join(more.values()))
    code = source_code(cls, name)
    digest.update(model_c(cls, name, blank_token, exposed, words.has_time, code, has_clock).encode())
    for file in sorted(FOLDER.iterdir()):
        digest.update(file.read_bytes())
    digest.update(
        f"{compiler.PLATFORMS} {STATE_MACHINE} {TABLE} {installed.version('ziglang')} {_start_values(cls)}".encode()
    )
    own = own or compiler.translate(cls, name)
    digest.update(f"{own.header}{own.source}".encode())
    token = f"{{{uuid.UUID(digest.hexdigest()[:32])}}}"
    files = {"modelDescription.xml": describe(cls, name, token, exposed), **more}
    return ExportPlan(name, token, model_c(cls, name, token, exposed, words.has_time, code, has_clock), files)


def _start_values(cls: type[Component]) -> str:
    """Hash of the record before initialization."""
    return hashlib.sha256(cls().record.tobytes()).hexdigest()


def archive(files: dict[str, bytes], order: Callable[[Iterable[str]], Iterable[str]] = sorted) -> bytes:
    """A zip that depends on nothing but its content; FMUs in it are compressed already."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as made_:
        for path in order(files):
            entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_STORED if path.endswith(".fmu") else zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix on every machine, so that the archive is independent of the machine
            entry.external_attr = 0o100644 << 16
            made_.writestr(entry, files[path])
    return buffer.getvalue()


def _content(own: compiler.Sources, version: str, made: ExportPlan, build: Path, targets: Sequence[str]) -> bytes:
    words = VERSIONS[version]
    for platform in targets:
        if platform not in compiler.PLATFORMS:
            raise BuildError(f"platform {platform!r} is not known. Use one of {', '.join(compiler.PLATFORMS)}.")
    if f"{made.name}.h" in {file.name for file in FOLDER.iterdir()}:
        raise BuildError(f"{made.name}: this name is a file of the FMU's own. Rename the component.")
    libraries = compiler.side_by_side(
        partial(library, made, words.source, own, platform, build) for platform in targets
    )
    archive_paths = [f"binaries/{words.folder(p)}/{made.name}{compiler.PLATFORMS[p].suffix}" for p in targets]
    return archive({**made.files, **dict(zip(archive_paths, libraries, strict=True))})


def origin(cls: type[Component], made: ExportPlan) -> str:
    """`documentation/origin.txt`: sources and tools that the FMU was built from."""
    parts = {name: part.component for name, part in getattr(cls, "parts", {}).items()} or {made.name: cls}
    folders = {}
    for name, part in parts.items():
        with suppress(TypeError, OSError):  # a class of a notebook's cell has no file
            folders[name] = Path(inspect.getfile(part)).parent
    lines = [f"{made.name}, content {made.token}", f"engine: twin {twin.__version__}, revision {revision(ENGINE)}"]
    return "\n".join([*lines, *(f"{name}: revision {revision(folder)}" for name, folder in folders.items()), ""])


def _add_sources(version: str, made: ExportPlan, own: compiler.Sources) -> None:
    """`sources/`; an FMU that is compiled from them has the same token, and understands saved states of this one."""
    files = {f"{own.name}.c": own.source.encode(), f"{own.name}.h": own.header.encode()}
    made.files.update(source_files(made.name, version, made.model, files))
    if version == "2.0":
        path = "modelDescription.xml"
        made.files[path] = listed(made.files[path], to_compile(made.files))


def export(
    cls: type[Component],
    version: str,
    path: Path,
    build: Path,
    targets: Sequence[str] = (),
    *,
    sources: bool = False,
    has_clock: bool = False,
) -> Path:
    """Write a component as an FMU to `path`, with binaries for the targets; for this machine if none are given.

    With `sources` it also holds its C, and says how an importer compiles it. With `has_clock` the sample period is an
    input clock of FMI 3.0, and Scheduled Execution is offered too.
    """
    own = compiler.sources(cls, model_name(cls), build)
    made = plan(cls, version, own, has_clock=has_clock)
    made.files["documentation/origin.txt"] = origin(cls, made).encode()
    if sources:
        _add_sources(version, made, own)
    write_atomically(Path(path), _content(own, version, made, build, targets or (compiler.host(),)))
    return Path(path)


def made(cls: type[Component], version: str, build: Path, targets: Sequence[str]) -> bytes:
    """A component's FMU with binaries for the targets; all obstacles are reported in one error."""
    with compiler.SYNTAX:
        if problems := source.check(cls):
            raise BuildError("\n".join(problems))
        own = compiler.sources(cls, model_name(cls), build)
        planned = plan(cls, version, own)
    return _content(own, version, planned, build, targets)
