"""A component becomes an FMU: native code, description, documentation, one reproducible archive.

The object file of `twin.compiled`, the state machine in `c/` and a generated table of variables are linked by zig's
clang into a library that needs libm and nothing else. Two exports of the same component are equal to the byte.
"""

from __future__ import annotations

import hashlib
import inspect
import io
import os
import subprocess
import sys
import tempfile
import uuid
import zipfile
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import twin
from twin import compiled, source, tangent
from twin.component import Component, PythonComponent, functions
from twin.errors import BuildError
from twin.fmi import description, terminals
from twin.fmi.description import Exposed
from twin.revision import revision
from twin.variable import Role

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

SOURCES = Path(__file__).with_name("c")
ENGINE = Path(__file__).parents[1]
TEMPLATES = ENGINE / "templates"


@dataclass(frozen=True, slots=True)
class Target:
    """How to link for a platform, and the name FMI 2.0 gives it (FMI 3.0's where it has none)."""

    triple: str
    suffix: str
    folder_2: str
    options: tuple[str, ...] = ()


ELF = ("-lm", "-s", "-Wl,--build-id=none", "-fno-asynchronous-unwind-tables")
MACHO = ("-s", "-Wl,-install_name,@rpath/library.dylib")  # else the name is the path of the temporary folder
TARGETS = {
    "x86_64-linux":   Target("x86_64-linux-gnu.2.17",  ".so",    "linux64",        ELF),
    "aarch64-linux":  Target("aarch64-linux-gnu.2.17", ".so",    "aarch64-linux",  ELF),
    "x86_64-windows": Target("x86_64-windows-gnu",     ".dll",   "win64",          ("-s",)),
    "x86_64-darwin":  Target("x86_64-macos.11.0",      ".dylib", "darwin64",       MACHO),
    "aarch64-darwin": Target("aarch64-macos.11.0",     ".dylib", "aarch64-darwin", MACHO),
}  # fmt: skip

# clang must not turn a loop into a call of memcpy, the record's bytes are read as what they hold, and sums are rounded
# as in the component's own code
COMPILE = (
    "-std=c23", "-O2", "-shared", "-fvisibility=hidden", "-fno-builtin", "-fno-strict-aliasing", "-ffp-contract=off",
    "-g0",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Version:
    """What differs between the versions of FMI: words, not steps."""

    source: str
    expose: Callable[[type[Component]], list[Exposed]]
    describe: Callable[[type[Component], str, str, list[Exposed]], bytes]
    folder: Callable[[str], str]
    has_time: bool
    more: Callable[[type[Component]], dict[str, bytes]]


VERSIONS = {
    "2.0": Version(
        "fmi2.c",
        description.expose_scalars,
        description.describe_2,
        lambda p: TARGETS[p].folder_2,
        False,
        terminals.none,
    ),
    "3.0": Version("fmi3.c", description.expose_arrays, description.describe_3, lambda p: p, True, terminals.files),
}


def model_name(cls: type[Component]) -> str:
    """Name of the model: the component's folder in `fmus`, else the class."""
    parts = cls.__module__.split(".")
    return parts[1] if len(parts) == 3 and parts[0] == "fmus" and parts[2] == "model" else cls.__name__


# ------------------------------------------------------------------------------------------------- generated C table

ACCESS = {Role.input: "INPUT", Role.parameter: "TUNABLE"}


def _access(exposed: Exposed) -> str:
    if exposed.variability == "fixed":
        return "FIXED"
    if exposed.causality == "input" and exposed.variability == "continuous":
        return "SIGNAL"
    return ACCESS.get(exposed.variable.role, "EXACT" if exposed.has_start else "CALCULATED")


def _c_table(cls: type[Component], name: str, token: str, exposed: list[Exposed], has_time: bool) -> str:
    """`component.h`: identity, start image, and one row per value reference."""
    names, places = "", {}
    for variable in cls.variables:
        places[variable.name] = len(names)
        names += variable.name + "\0"
    rows = [f"{{TIME, 1, {len(names)}, FLOAT64, 8, CALCULATED, false}}"] if has_time else []
    names += "time\0"
    for e in exposed:
        variable = e.variable
        count = len(e.start)
        kind = f"{variable.type.upper()}, {variable.dtype.itemsize}, {_access(e)}"
        seen = description.text(has_time and description.is_intermediate(cls, e))
        rows.append(f"{{{e.offset}, {count}, {places[variable.name]}, {kind}, {seen}}}")
    image = cls().record.tobytes()
    words = [f"0x{int.from_bytes(image[i : i + 8], 'little'):x}" for i in range(0, len(image), 8)]
    states = [v for v in cls.variables if v.role is Role.state]
    derivatives = [v for v in cls.variables if v.role is Role.derivative]
    nominals = [repr(v.nominal or 1.0) for v in states for _ in range(v.size)]
    indicators = [cls.layout.offset(v.name) + 8 * i for v in description.switches(cls) for i in range(v.size)]
    identity = uuid.UUID(token.strip("{}")).int
    letters = ",".join(map(str, names.encode()))
    return "\n".join(
        [
            f'#define MODEL "{name}"',
            f'#define TOKEN "{token}"',
            f"#define RECORD_SIZE {len(image)}",
            f"#define FIELD_COUNT {len(rows)}u",
            f"#define EXCHANGE {int(description.offers_exchange(cls))}",
            f"#define DIRECTIONAL {int(description.offers_derivatives(cls))}",
            f"#define PERIOD {cls.period_ns}ll",
            f"#define BEGIN {cls.layout.offset('_begin') if cls.period_ns else 0}",
            f"#define TICK {cls.layout.offset('_tick') if cls.period_ns else 0}",
            f"#define SUBSTEP {cls.method.substep if states else 0.0!r}",
            f"#define STATE_COUNT {len(nominals)}",
            f"#define STATES {cls.layout.offset(states[0].name) if states else 0}",
            f"#define DERIVATIVES {cls.layout.offset(derivatives[0].name) if states else 0}",
            f"#define INDICATOR_COUNT {len(indicators)}",
            f"static const int32_t INDICATORS[] = {{{', '.join(map(str, indicators)) or '0'}}};",
            f"static const double NOMINALS[] = {{{', '.join(nominals) or '0'}}};",
            f"static const uint64_t IDENTITY[2] = {{0x{identity >> 64:x}, 0x{identity & (2**64 - 1):x}}};",
            f"static const uint64_t START[] = {{{', '.join(words)}}};",
            f"static const char NAMES[] = {{{letters}}};",
            "static const Field FIELDS[] = {",
            *(f"    {row}," for row in rows or ["{0, 0, 0, NO_TYPE, 0, CALCULATED, false}"]),
            "};",
            "",
        ]
    )


# -------------------------------------------------------------------------------------------------------------- link


def link(platform: str, source: str, table: str, codes: Sequence[bytes]) -> bytes:
    """The shared library of an FMU for a platform, from object files."""
    target = TARGETS[platform]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "component.h").write_text(table, encoding="utf-8")
        objects = [place / f"component{i}.o" for i in range(len(codes))]
        for path, code in zip(objects, codes, strict=True):
            path.write_bytes(code)
        library = place / f"library{target.suffix}"
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target.triple, *COMPILE, f"-I{place}"]
        command += [str(SOURCES / source), *map(str, objects), "-o", str(library), *target.options]
        result = subprocess.run(command, capture_output=True, text=True, cwd=place, check=False)
        if result.returncode:
            raise BuildError(f"{platform}: the library cannot be linked: {result.stderr.strip()[-2000:]}")
        return library.read_bytes()


# ----------------------------------------------------------------------------------------------------- documentation


def _readme(cls: type[Component]) -> str:
    """README.md of a component's folder; empty for a class that lives elsewhere."""
    if model_name(cls) == cls.__name__:
        return ""
    readme = Path(inspect.getfile(cls)).with_name("README.md")
    return readme.read_text(encoding="utf-8") if readme.exists() else ""


@cache
def _page() -> Any:
    """The template of the documentation, compiled once."""
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True)
    return environment.get_template("documentation.html")


def documentation(cls: type[Component], version: str) -> str:
    """`documentation/index.html`: docstring, README, variables with units, starts and sources."""
    import markdown_it

    markdown = markdown_it.MarkdownIt("commonmark", {"html": False}).enable("table")
    groups = [(role, [v for v in cls.variables if v.role is role]) for role in Role if role is not Role.derivative]
    page: str = _page().render(
        name=model_name(cls), version=version, summary=description.summary(cls),
        docstring=inspect.cleandoc(cls.__doc__ or "").partition("\n")[2].strip(),
        readme=markdown.render(_readme(cls)), groups=groups, period=cls.period, text=_start_text, terminals=cls.terminals,
        exchange=description.offers_exchange(cls), underivable=underivable(cls),
    )  # fmt: skip
    return page


def underivable(cls: type[Component]) -> str:
    """Why a continuous component offers no directional derivatives; empty if it does, or is not continuous."""
    found = tangent.tangents(cls)
    return found if description.offers_exchange(cls) and isinstance(found, str) else ""


def _start_text(variable: Any) -> str:
    """A start value short enough for a table."""
    values = variable.start_array().reshape(-1).tolist()
    if all(value == values[0] for value in values):
        return description.text(values[0])
    return " ".join(map(description.text, values[:8])) + (" ..." if len(values) > 8 else "")


# ------------------------------------------------------------------------------------------------------------ archive


@dataclass(frozen=True, slots=True)
class Plan:
    """All of an FMU but its binaries, and the token that stands for its content."""

    name: str
    token: str
    table: str
    files: dict[str, bytes]


def plan(cls: type[Component], version: str) -> Plan:
    """What an export would contain; cheap, so it also decides whether one is needed."""
    if issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: is Python-side and cannot be an FMU. Derive it from Component instead.")
    if version not in VERSIONS:
        raise BuildError(f"FMI version {version!r} is not offered. Use one of {', '.join(VERSIONS)}.")
    words, name = VERSIONS[version], model_name(cls)
    exposed = words.expose(cls)
    more = {"documentation/index.html": documentation(cls, version).encode(), **words.more(cls)}
    nobody = f"{{{uuid.UUID(int=0)}}}"
    digest = hashlib.sha256(words.describe(cls, name, nobody, exposed) + b"".join(more.values()))
    digest.update(_c_table(cls, name, nobody, exposed, words.has_time).encode())
    for file in sorted(SOURCES.iterdir()):
        digest.update(file.read_bytes())
    digest.update(f"{TARGETS} {COMPILE} {metadata.version('ziglang')}".encode())
    code = (*functions(cls), *(entry.function for entry in compiled.exchange_entries(cls)))
    token = f"{{{uuid.UUID(compiled.content_hash(code, digest.hexdigest()))}}}"
    files = {"modelDescription.xml": words.describe(cls, name, token, exposed), **more}
    return Plan(name, token, _c_table(cls, name, token, exposed, words.has_time), files)


def _archive(files: dict[str, bytes]) -> bytes:
    """A zip that depends on nothing but its content."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(files):
            entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix on every machine, so that the archive does not tell where it was made
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, files[path])
    return buffer.getvalue()


def _write(path: Path, content: bytes) -> None:
    """Replace a file at once: whoever reads sees the old or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_bytes(content)
    partial.replace(path)


def _content(cls: type[Component], version: str, made: Plan, build: Path, targets: Sequence[str]) -> bytes:
    words = VERSIONS[version]
    files = dict(made.files)
    for platform in targets:
        if platform not in TARGETS:
            raise BuildError(f"platform {platform!r} is not known. Use one of {', '.join(TARGETS)}.")
        codes = [compiled.component_object(cls, platform, build), compiled.exchange_object(cls, platform, build)]
        library = link(platform, words.source, made.table, [code for code in codes if code])
        files[f"binaries/{words.folder(platform)}/{made.name}{TARGETS[platform].suffix}"] = library
    return _archive(files)


def origin(cls: type[Component], made: Plan) -> str:
    """`documentation/origin.txt`: what the FMU was made from and by, to find its sources again."""
    parts = {name: part.component for name, part in getattr(cls, "parts", {}).items()} or {made.name: cls}
    folders = {name: Path(inspect.getfile(part)).parent for name, part in parts.items()}
    lines = [f"{made.name}, content {made.token}", f"engine: twin {twin.__version__}, revision {revision(ENGINE)}"]
    return "\n".join([*lines, *(f"{name}: revision {revision(folder)}" for name, folder in folders.items()), ""])


def export(cls: type[Component], version: str, path: Path, build: Path, targets: Sequence[str] = ()) -> Path:
    """Write a component as an FMU to `path`, with binaries for the targets; for this machine if none are given."""
    made = plan(cls, version)
    made.files["documentation/origin.txt"] = origin(cls, made).encode()
    _write(Path(path), _content(cls, version, made, build, targets or (compiled.host(),)))
    return Path(path)


_plans: dict[tuple[type[Component], str], Plan] = {}


def _checked(cls: type[Component], version: str) -> Plan:
    """The plan of a component without problems: a class does not change, and a scenario has it once per variant."""
    if (cls, version) not in _plans:
        if problems := source.check(cls):
            raise BuildError("\n".join(problems))
        _plans[cls, version] = plan(cls, version)
    return _plans[cls, version]


def build(cls: type[Component], version: str, build: Path, targets: Sequence[str] = ()) -> Path:
    """The component's FMU in `build/<version>/`, made anew only if what it is made from, or a target, is new."""
    made = _checked(cls, version)
    wanted = tuple(targets) or (compiled.host(),)
    path = build / version / f"{made.name}.fmu"
    note = path.with_suffix(".hash")
    token, *present = note.read_text().split() if note.exists() and path.exists() else [""]
    if token == made.token and set(wanted) <= set(present):
        return path
    note.unlink(missing_ok=True)
    _write(path, _content(cls, version, made, build, wanted))
    _write(note, f"{made.token} {' '.join(wanted)}\n".encode())
    return path
