"""Reader of OspSystemStructure.xml, the system description of the Open Simulation Platform (libcosim), as a variant of an SSP.

Groups of variables are those of the files MODEL_OspModelDescription.xml beside it or beside the FMU. As in libcosim, values are not
converted between units, and a simulator's step is a multiple of the base step.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, unquote, urlsplit

from twin.errors import ScenarioError, nearest
from twin.ssp.document import parse_root
from twin.ssp.model import Binding, End, Linear, Messages, Parameter, SspConnection, SspElement
from twin.ssp.values import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator

STRUCTURE = "{http://opensimulationplatform.com/MSMI/OSPSystemStructure}"
MODEL = "{*}"  # namespace of a model description, which some files leave out
ROOT = f"{STRUCTURE}OspSystemStructure"
SHORTEST_STEP = 1e-9  # [s]


class OspReader:
    """Reader of one system description and of the model descriptions that it needs."""

    def __init__(self, path: Path, shown: str, messages: Messages) -> None:
        self.path, self.shown, self.messages = path, shown, messages
        self.root = parse_root(path.read_bytes(), shown, messages.deviations)
        if self.root.tag != ROOT:
            raise ScenarioError(f"{shown}: is no OspSystemStructure. Name one, an SSP, or a scenario in YAML.")
        self.base_step = self.time("BaseStepSize")
        self.models: dict[str, Path] = {}  # simulator -> FMU
        self.functions = {
            node.get("name", ""): Linear(self.number(node, "factor", 1.0), self.number(node, "offset", 0.0))
            for node in self.root.iterfind(f"{STRUCTURE}Functions/{STRUCTURE}LinearTransformation")
        }

    def where(self, node: Any) -> str:
        """Return file:line of an element."""
        return f"{self.shown}:{node.sourceline}"

    def number(self, node: Any, key: str, default: float) -> float:
        """Parse an attribute; report an invalid one and return the default."""
        number = self.real(node, key, node.get(key, str(default)))
        return default if number is None else number

    def real(self, node: Any, what: str, text: str) -> float | None:
        """Parse a number; report an invalid one and return None."""
        try:
            return float(KINDS["Real"](text))
        except ValueError as error:
            self.messages.problems.append(f"{self.where(node)}: {what}: {error}.")
            return None

    def time(self, tag: str) -> float | None:
        """Parse a time [s] of the description; None if it is not given."""
        node = self.root.find(f"{STRUCTURE}{tag}")
        return None if node is None else self.real(node, tag, node.text or "")

    def system(self) -> SspElement:
        """Return the root system with all simulators and connections."""
        system = SspElement("system", self.path.stem, self.where(self.root))
        system.elements = [self.simulator(node) for node in self.root.iterfind(f"{STRUCTURE}Simulators/*")]
        system.connections = list(self.connections())
        for tag in ("Sum", "VectorSum"):
            for node in self.root.iterfind(f"{STRUCTURE}Functions/{STRUCTURE}{tag}"):
                text = f"{tag} `{node.get('name')}` cannot be computed here. Put a component that adds in its place"
                self.messages.problems.append(f"{self.where(node)}: {text}.")
        algorithm = self.root.find(f"{STRUCTURE}Algorithm")
        if algorithm is not None and (algorithm.text or "").strip() not in ("", "fixedStep"):
            text = f"the algorithm {(algorithm.text or '').strip()[:40]} is not read: name one with --set algorithm=..."
            self.messages.notes.append(f"{self.where(algorithm)}: {text}")
        return system

    def simulator(self, node: Any) -> SspElement:
        """Return a simulator as a component with its start values and its step."""
        where, name = self.where(node), node.get("name", "")
        element = SspElement("component", name, where)
        source = urlsplit(node.get("source", ""))
        file = unquote(source.path)
        if source.scheme == "proxyfmu":
            file = parse_qs(source.query).get("file", [""])[0]
            self.messages.deviations.append(f"{where}: `{name}` is run here, not by a proxy at {source.netloc}.")
        elif source.scheme:
            self.messages.problems.append(f"{where}: `{node.get('source')[:80]}` is no path. Name a file.")
        path = (self.path.parent / file).resolve()
        if not path.is_file():
            self.messages.problems.append(f"{where}: `{file[:80]}` is not there. Correct the path.")
        element.fmu, self.models[name] = str(path), path
        if (step := self.number(node, "stepSize", 0.0)) > 0.0 and self.base_step is not None:
            element.communication_step = max(1, round(step / max(self.base_step, SHORTEST_STEP))) * self.base_step
        parameters = []
        for value_node in node.iterfind(f"{STRUCTURE}InitialValues/{STRUCTURE}InitialValue"):
            for typed in value_node.iterfind("*"):
                kind = str(typed.tag).rpartition("}")[2]
                message_prefix = f"{self.where(typed)}: {value_node.get('variable')}"
                try:
                    value = KINDS[kind](typed.get("value", ""))
                except KeyError:
                    text = f"a value of type `{kind}` cannot be read. Use Real, Integer, Boolean or String"
                    self.messages.problems.append(f"{message_prefix}: {text}.")
                    continue
                except ValueError as error:
                    self.messages.problems.append(f"{message_prefix}: {error}.")
                    continue
                parameters.append(Parameter(value_node.get("variable", ""), value, None, self.where(value_node)))
        element.bindings.append(Binding(parameters, None, where))
        return element

    def connections(self) -> Iterator[SspConnection]:
        """Yield connections of variables, of groups of variables, and through linear transformations."""
        for node in self.root.iterfind(f"{STRUCTURE}Connections/*"):
            kind, where = str(node.tag).rpartition("}")[2], self.where(node)
            ends = [
                (end.get("simulator", ""), end.get("name", ""))
                for end in node.iterfind("*")
                if "simulator" in end.attrib
            ]
            if kind == "VariableConnection" and len(ends) == 2:
                yield connection(ends[0], ends[1], None, where)
            elif kind == "VariableGroupConnection" and len(ends) == 2:
                yield from self.group_connection(ends[0], ends[1], where)
            elif kind != "SignalConnection":
                self.messages.problems.append(f"{where}: a {kind} cannot be read. Connect variables instead.")
        yield from self.transformed()

    def transformed(self) -> Iterator[SspConnection]:
        """Yield the connections through linear transformations: variable -> in, out -> variable."""
        signals: dict[tuple[str, str], list[tuple[tuple[str, str], str]]] = {}
        for node in self.root.iterfind(f"{STRUCTURE}Connections/{STRUCTURE}SignalConnection"):
            variable, signal = node.find(f"{STRUCTURE}Variable"), node.find(f"{STRUCTURE}Signal")
            if variable is None or signal is None:
                self.messages.problems.append(f"{self.where(node)}: a connection has one Variable and one Signal.")
                continue
            key = (signal.get("function", ""), signal.get("name", ""))
            end = (variable.get("simulator", ""), variable.get("name", ""))
            signals.setdefault(key, []).append((end, self.where(node)))
        for name, change in self.functions.items():
            for source, _ in signals.get((name, "in"), []):
                for target, where in signals.get((name, "out"), []):
                    yield connection(source, target, change, where)

    def group_connection(self, first: tuple[str, str], second: tuple[str, str], where: str) -> Iterator[SspConnection]:
        """Yield the connections of two groups, variable by variable in their order."""
        groups = [self.group(simulator, name, where) for simulator, name in (first, second)]
        if not all(groups):
            return
        if len(groups[0]) != len(groups[1]):
            text = f"`{first[1]}` has {len(groups[0])} variables, `{second[1]}` {len(groups[1])}. Connect variables instead"
            self.messages.problems.append(f"{where}: {text}.")
            return
        for start, end in zip(*groups, strict=True):
            yield connection((first[0], start), (second[0], end), None, where)

    def group(self, simulator: str, name: str, where: str) -> list[str]:
        """Return the variables of a group, those of inner groups sorted by the kind of group; [] after adding a problem."""
        model = self.models.get(simulator)
        if model is None:
            hint = nearest(simulator, self.models, "`")
            self.messages.problems.append(f"{where}: there is no simulator `{simulator}`. {hint}")
            return []
        file_name = f"{model.stem}_OspModelDescription.xml"
        files = (
            file
            for folder in (self.path.parent, model.parent)
            for file in sorted(folder.glob("*_OspModelDescription.xml"))
        )
        file = next((file for file in files if file.name.casefold() == file_name.casefold()), None)
        if file is None:
            self.messages.problems.append(f"{where}: there is no {file_name} for the group `{name}`. Add it.")
            return []
        root = parse_root(file.read_bytes(), str(file), self.messages.deviations)
        groups = {node.get("name", ""): node for node in root.iterfind(f"{MODEL}VariableGroups/*")}
        if name not in groups:
            self.messages.problems.append(f"{where}: {file.name} has no group `{name}`. {nearest(name, groups, '`')}")
            return []
        return variables(groups[name])


def variables(group: Any) -> list[str]:
    """Return the variables of a group; inner groups in the order of their kinds, so that two models agree on it."""
    own = [node.get("ref", "") for node in group.iterfind(f"{MODEL}Variable")]
    inner = sorted(
        (node for node in group.iterfind("*") if not node.tag.endswith("Variable")), key=lambda node: node.tag
    )
    return own + [name for node in inner for name in variables(node)]


def connection(start: tuple[str, str], end: tuple[str, str], change: Linear | None, where: str) -> SspConnection:
    """Return a connection of two variables without conversion of units."""
    return SspConnection(End(*start), End(*end), change, True, where)
