"""One-line messages for pydantic's validation errors: file and line, what is wrong, what was expected, what to do."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel, ValidationError

from twin.errors import ScenarioError
from twin.scenario.keys.quantities import short
from twin.scenario.keys.schema import ScenarioKeys
from twin.scenario.resolution.variable_names import nearest
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.errors import TwinError

Path = tuple[str | int, ...]
Steps = dict[str | int | None, "Steps"]

EXAMPLES = {
    "from": "from: servo.position",
    "to": "to: sheath.gripper_position",
    "at": "at: 5 s",
    "signal": "signal: sensor.force",
    "reduce": "reduce: std",
    "title": "title: Contact force",
}

SYNONYMS = {"min": "at_least", "max": "at_most", "description": "title"}  # unknown key: the one that is meant

KINDS = {
    "string_type": "text",
    "list_type": "a list",
    "dict_type": "a group of `key: value` lines",
    "model_type": "a group of `key: value` lines",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "tuple_type": "a list",
}
BOUNDS = {
    "greater_than": "a number above {gt:.10g}",
    "greater_than_equal": "at least {ge:.10g}",
    "less_than": "a number below {lt:.10g}",
    "less_than_equal": "at most {le:.10g}",
    "too_short": "at least {min_length} values, not {actual_length}",
    "too_long": "at most {max_length} values, not {actual_length}",
    "string_too_short": "a text",
}


def validate(root: Node, model: Any = ScenarioKeys) -> tuple[Any, Node, list[str]]:
    """Validate a tree against a model: (keys, tree, problems).

    Invalid parts are removed from keys and tree, so that names and units in the rest can be checked in the same run.
    """
    problems: list[str] = []
    for attempt in range(12):
        try:
            return model.model_validate(root.plain()), root, problems
        except ValidationError as error:
            errors = error.errors(include_url=False)
            if attempt == 0:
                problems += [line(root, details, model) for details in errors]
            root = dropped(
                root, steps(details["loc"][: -1 if details["type"] == "missing" else None] for details in errors)
            )
    return model(), Node({}, root.location), problems


def steps(paths: Iterable[Path]) -> Steps:
    """Nest paths by their steps; the key None marks the end of a path."""
    nested: Steps = {}
    for path in paths:
        level = nested
        for step in path:
            level = level.setdefault(None if step == "[key]" else step, {})
        level[None] = {}
    return nested


def entry_steps(node: Node, invalid: Steps) -> Steps:
    """Return the steps below a node; without that into a list if the schema reads this single entry as a list of one."""
    return invalid[0] if 0 in invalid and not isinstance(node.value, list) else invalid


def dropped(node: Node, invalid: Steps) -> Node:
    """Return the tree without the nodes at the invalid paths."""
    if not invalid:
        return node
    if isinstance(node.value, dict):
        below = {key: entry_steps(item, invalid.get(key, {})) for key, item in node.value.items()}
        entries = {key: dropped(item, below[key]) for key, item in node.value.items() if None not in below[key]}
        return Node(entries, node.location)
    items = [dropped(item, invalid.get(i, {})) for i, item in enumerate(node.items) if None not in invalid.get(i, {})]
    return Node(items, node.location) if isinstance(node.value, list) else node


def line(root: Node, error: Any, model: Any = ScenarioKeys) -> str:
    """Format one validation error as one line."""
    path: Path = tuple(step for step in error["loc"] if step != "[key]")
    location = root.find(path).location
    key_path = dotted(path)
    kind, value = error["type"], error["input"]
    if kind == "extra_forbidden":
        prefix = f"{dotted(path[:-1])}: " if path[:-1] else ""
        groups = groups_with(str(path[-1]), model) if len(path) == 1 else []
        remedy = f" It belongs to `{groups[0]}`: `{groups[0]}: {{{path[-1]}: ...}}`." if len(groups) == 1 else ""
        keys = [*keys_at(path[:-1], model)]
        meant = SYNONYMS.get(str(path[-1]), "")
        remedy = remedy or (f" Did you mean `{meant}`?" if meant in keys else nearest(str(path[-1]), keys))
        return f"{location}: {prefix}unknown key `{path[-1]}`.{remedy}"
    if kind == "missing":
        example = EXAMPLES.get(str(path[-1]), f"{path[-1]}: ...")
        return f"{location}: {dotted(path[:-1])}: `{path[-1]}` is missing. Add it, such as `{example}`."
    if kind == "value_error":
        text = error["msg"].removeprefix("Value error, ").rstrip(".")
        return f"{location}: {key_path}: {text}{'' if text.endswith('?') else '.'}"
    if kind == "literal_error":
        choices = error["ctx"]["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        return f"{location}: {key_path}: `{short(value)}` is not known.{nearest(str(value), choices)}"
    if path[0] == "connections" and len(path) == 2 and isinstance(value, str):
        return f"{location}: {key_path}: {quoted(value)} is no connection. {arrow(value)}"
    if expected := KINDS.get(kind) or BOUNDS.get(kind, "").format_map(error.get("ctx", {})):
        text = expected if "not" in expected else f"{expected}, not {quoted(value)}"
        return f"{location}: {key_path}: expected {text.replace(' 1 values', ' 1 value')}."
    return f"{location}: {key_path}: {error['msg'][0].lower()}{error['msg'][1:]}, not {quoted(value)}."


def arrow(text: str) -> str:
    """Return advice on the syntax of a connection, from the invalid text."""
    ends = [end.strip() for end in re.split(r"\s*(?:[-=]+\s*>|<\s*[-=]+|→|>)\s*", text)]
    if "<" in text:
        ends.reverse()
    good = len(ends) == 2 and all(re.fullmatch(r"\w+\.[\w.\[\],]+", end) for end in ends)
    return f"Write `{' -> '.join(ends) if good else 'servo.position -> sheath.gripper_position'}`."


def quoted(value: Any) -> str:
    """Format a value for a message, text in backquotes."""
    return f"`{short(value)}`" if isinstance(value, str) else short(value)


def dotted(path: Path) -> str:
    """Format a path: `metrics.force.reduce`; items of lists by their number from 1: `events[2].at`."""
    text = ""
    for step in path:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}"
    return text.removeprefix(".")


def keys_at(path: Path, model: Any = ScenarioKeys) -> list[str]:
    """Return the keys that a group may have."""
    for step in path:
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            continue
        fields = {field.alias or name: field.annotation for name, field in model.model_fields.items()}
        model = inner(fields.get(str(step))) or model  # a name or a number in between: the group is the same
    return [field.alias or name for name, field in model.model_fields.items()]


def groups_with(key: str, model: Any) -> list[str]:
    """Return the groups of keys at the top of a file that may have a key."""
    return [
        field.alias or name
        for name, field in model.model_fields.items()
        if isinstance(field.annotation, type)
        and issubclass(field.annotation, BaseModel)
        and key in keys_at((), field.annotation)
    ]


def inner(annotation: Any) -> Any:
    """Return the model inside `dict[str, Model]`, `list[Model]` or `Model | None`; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        if (model := inner(argument)) is not None:
            return model
    return None


def by_line(problem: str) -> tuple[str, int]:
    """Sort key of problems: those of the options first, then by file and line."""
    file, _, rest = problem.partition(":")
    digits = rest.partition(":")[0]
    return file, int(digits) if digits.isdigit() else 0


class KeyFile:
    """The keys of a file, as a tree with locations; `problems` grow while they are read."""

    def __init__(self, root: Node, problems: list[str]) -> None:
        self.root, self.problems = root, problems

    def location(self, *path: str | int) -> str:
        """Return file:line of a key."""
        return str(self.root.find(path).location)

    def add_problem(self, error: TwinError | str, *path: str | int) -> None:
        """Add the problems of a key."""
        texts = [error] if isinstance(error, str) else error.problems
        self.problems += [f"{self.location(*path)}: {dotted(path)}: {text}" for text in texts]

    def stop_if_wrong(self) -> None:
        """Raise ScenarioError if there are problems."""
        if self.problems:
            raise ScenarioError(sorted(dict.fromkeys(self.problems), key=by_line))
