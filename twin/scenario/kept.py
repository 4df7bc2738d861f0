"""Checked scenarios, kept under what they were made from: what has not changed is neither read nor checked again.

A scenario is plain data once it is checked and its components are built, and kept as such: JSON with its hash in front.
It counts if its file and all that was read for it, the components' sources, their FMUs, the engine and the libraries that
have a say are what they were; else, and where the file is damaged or cannot be written, all is done as if nothing had
been kept.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import installed
from twin.component import Component, PythonComponent, catalog
from twin.coupling import Algorithm, MemberVariable, TerminalMember
from twin.dataclass import dataclass
from twin.errors import ScenarioError, TwinError
from twin.files import write_atomically
from twin.results import Curve, Expectation, Expression, Metric, Plot, Window, expression
from twin.scenario.members import Built, Form, as_built, communication, component_of
from twin.scenario.node import Node, Place
from twin.scenario.shipped import located
from twin.scenario.spec import Case, ConnectionSpec, ControlSpec, EventSpec, Exchange, MemberSpec, RecordSpec, Scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from twin.coupling import Catalog

ENGINE = Path(__file__).parents[1]
LIBRARIES = ("numpy", "pint", "pydantic", "PyYAML", "ziglang")
SUFFIXES = (".py", ".md", ".c", ".h", ".html")  # of what decides what a component's FMU is
LARGEST = 4_000_000  # of a text that is kept [byte]: beyond it, reading takes as long as checking
KNOWN = {"twin", "numpy", *sys.stdlib_module_names}  # modules whose changes are seen, or that do not change
KINDS: dict[str, Any] = {
    one.__name__: one
    for one in (
        *(Scenario, Case, MemberSpec, ConnectionSpec, ControlSpec, EventSpec, Exchange, RecordSpec, Node, Place, Built),
        *(Metric, Expectation, Plot, Curve, Window, MemberVariable, TerminalMember),
    )
}


@dataclass(frozen=True)
class Checked:
    """A scenario in which nothing is wrong, with its members' variables by variant."""

    scenario: Scenario
    catalogs: Mapping[str, Catalog]
    place: Path | None = None  # where to keep it, if it is not kept yet
    read: tuple[str, ...] = ()  # files

    def keep(self, build: Path) -> None:
        """Keep it, once all that it is made of is built, if it is nothing but data: not what holds code of its own."""
        scenario = self.scenario
        if self.place is None or scenario.analyses or scenario.scenes:
            return
        try:
            scenario = replace(
                scenario, text=scenario.frozen(), variants=tuple(settled(case, build) for case in scenario.variants)
            )
            specs = [spec for case in scenario.variants for spec in case.members.values()]
            fmus = sorted({one.built.path if one.built else one.component for one in specs})
            variables = list({id(one): one for case in self.catalogs.values() for one in case.values()}.values())
            numbers = {id(one): number for number, one in enumerate(variables)}
            catalogs = {
                variant: {member: numbers[id(one)] for member, one in case.items()}
                for variant, case in self.catalogs.items()
            }
            origin = json.dumps(made_from(self.read, [one for one in fmus if one.endswith(".fmu")]))
            text = f"{origin}\n{json.dumps(encoded([scenario, variables, catalogs]))}"
            if len(text) < LARGEST:
                put(self.place, f"{digest(text)}\n{text}")
        except (TypeError, OSError, TwinError):
            return  # something that is no plain data, or no place to keep it


def checked(path: Path, overrides: Sequence[str], build: Path, form: Form = Form.fmu) -> Checked:
    """A scenario with its members' variables, all of it checked; ScenarioError lists every problem.

    What is kept has FMUs for members; a run in another `form` needs the components themselves.
    """
    path = located(path)
    place = build / "scenarios" / f"{digest(str(Path.cwd()), str(build), str(path), *overrides)[:32]}.json"
    if form is Form.fmu and (found := find(place)) is not None:
        return found
    from twin.scenario.dimensions import displayed
    from twin.scenario.load import load_scenario
    from twin.scenario.lookup import look_up
    from twin.scenario.package import BUILD
    from twin.scenario.tree import READ

    read: set[str] = set()
    token, below = READ.set(read), BUILD.set(build)
    try:
        scenario = load_scenario(path, overrides)
    finally:
        READ.reset(token)
        BUILD.reset(below)
    catalogs, problems = look_up(scenario)
    if problems:
        raise ScenarioError(problems)
    return Checked(displayed(scenario, catalogs), catalogs, place if form is Form.fmu else None, tuple(sorted(read)))


def find(place: Path) -> Checked | None:
    """What is kept, if it still holds."""
    try:
        sum_, _, text = place.read_text().partition("\n")
        if sum_ != digest(text):
            return None
        line, _, content = text.partition("\n")
        origin = json.loads(line)
        if origin != made_from(origin["files"], origin["fmus"]):
            return None
        scenario, variables, catalogs = json.loads(content, object_hook=decoded)
    except (OSError, ValueError, TypeError, LookupError, AttributeError, TwinError):
        return None  # nothing is kept, or something that it was made from is gone: whoever checks it will say so
    return Checked(
        scenario,
        {
            variant: {member: variables[number] for member, number in members.items()}
            for variant, members in catalogs.items()
        },
    )


def settled(case: Case, build: Path) -> Case:
    """A case whose members are FMUs; TypeError if one is made of somebody's own module, which may import anything."""
    members = {}
    for name, spec in case.members.items():
        made = component_of(spec)
        if isinstance(made, str) and made.endswith(".fmu"):
            members[name] = spec
            continue
        cls = catalog.component(made) if isinstance(made, str) else made
        if not isinstance(cls, type) or not all(map(is_ours, parts(cls))):
            raise TypeError(f"{name} is made of more than the catalog's sources")
        if issubclass(cls, PythonComponent):
            members[name] = spec
            continue
        rhythm = communication(spec)
        members[name] = replace(spec, made=None, built=as_built(cls, build), period_ns=None, communication_ns=rhythm)
    return replace(case, members=members)


def parts(cls: type[Component]) -> Iterable[type[Component]]:
    """A component, or those that a group is made of."""
    inside = getattr(cls, "parts", {})
    return [one for part in inside.values() for one in parts(part.component)] if inside else [cls]


def is_ours(cls: type[Component]) -> bool:
    """Whether a component is made of the catalog's sources alone, which are looked at: it, and all that it imports."""
    waiting, seen, places = [cls.__module__], set[str](), catalog.places()
    while waiting:
        module = sys.modules.get(waiting.pop())
        file = getattr(module, "__file__", None)
        if file is None or not any(Path(file).is_relative_to(place) for place in places):
            return False
        imported = {
            name for name in imports(file, Path(file).stat().st_mtime_ns) if name.partition(".")[0] not in KNOWN
        }
        waiting += [name for name in imported - seen if name.startswith("fmus.")]
        seen |= imported
        if any(not name.startswith("fmus.") and name != "fmus" for name in imported):
            return False
    return True


@cache
def imports(file: str, _changed: int) -> frozenset[str]:
    """Names of the modules that a file imports, those that are not loaded by themselves left out."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{one.name}" for one in node.names]
            found |= {name if name in sys.modules else f"{node.module}" for name in names}
    return frozenset(found)


def made_from(files: Iterable[str], fmus: Iterable[str]) -> dict[str, Any]:
    """Hashes of all that decides what a scenario is, whether it is right, and what its FMUs are."""
    return {
        "engine": sources(str(ENGINE)),
        "components": {place: sources(place) for place in catalog.places()},
        "libraries": {name: installed.version(name) for name in LIBRARIES},
        "files": {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in files},
        "fmus": {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in fmus},
    }


@cache
def sources(folder: str) -> str:
    """Hash of the sources in a folder by name, size and time."""
    words, waiting = [], [folder]
    while waiting:
        with os.scandir(waiting.pop()) as found:
            for one in found:
                if one.name.endswith(SUFFIXES):
                    told = one.stat()
                    words.append(f"{one.path} {told.st_size} {told.st_mtime_ns}")
                elif one.name != "__pycache__" and one.is_dir(follow_symlinks=False):
                    waiting.append(one.path)
    return digest(*sorted(words))


def put(place: Path, text: str) -> None:
    """Write a file at once: others see none of it or all."""
    place.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(place, text)


def digest(*words: str) -> str:
    """Hash of texts."""
    return hashlib.sha256("\0".join(words).encode()).hexdigest()


def encoded(value: Any) -> Any:
    """As JSON has it: what is no text, number or list, as a dict of its kind and content; TypeError for other things."""
    match value:
        case None | bool() | str():
            return value
        case np.generic() if value.dtype.kind != "O":
            return {"scalar": [value.dtype.str, value.item()]}
        case int() | float():
            return value
        case list():
            return [encoded(one) for one in value]
        case tuple():
            return {"tuple": [encoded(one) for one in value]}
        case Mapping():
            return {"dict": [[encoded(key), encoded(one)] for key, one in value.items()]}
        case Fraction():
            return {"ratio": str(value)}
        case Algorithm():
            return {"algorithm": encoded({"name": value.name, **value.options})}
        case Path():
            return {"path": str(value)}
        case np.dtype():
            return {"dtype": value.str}
        case np.ndarray():
            return {"array": [value.dtype.str, list(value.shape), [encoded(one) for one in value.reshape(-1).tolist()]]}
        case bytes():
            return {"bytes": value.hex()}
        case Expression():
            return {"expression": value.text}
    if type(value).__name__ in KINDS and is_dataclass(value):
        return {type(value).__name__: [encoded(getattr(value, one.name)) for one in fields(value)]}
    raise TypeError(f"{type(value).__name__} is no plain data")


DECODERS: dict[str, Callable[[Any], Any]] = {
    "ratio": Fraction,
    "algorithm": lambda told: Algorithm(told),  # noqa: PLW0108 - it is called as no class is
    "scalar": lambda told: np.dtype(told[0]).type(told[1]),
    "tuple": tuple,
    "dict": dict,
    "path": Path,
    "dtype": np.dtype,
    "array": lambda told: np.array(told[2], told[0]).reshape(told[1]),
    "bytes": bytes.fromhex,
    "expression": expression.parse,
}


def decoded(told: dict[str, Any]) -> Any:
    """What was encoded as a dict, with all in it that was: to be called by `json.loads`."""
    ((kind, content),) = told.items()
    return KINDS[kind](*content) if kind in KINDS else DECODERS[kind](content)
