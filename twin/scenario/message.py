"""What pydantic finds, as one line each: file and line, what, what was expected, what to do."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from twin.scenario.merge import nearest
from twin.scenario.model import ScenarioKeys
from twin.scenario.tree import Node
from twin.scenario.value import short

Path = tuple[str | int, ...]

EXAMPLES = {
    "from": "from: servo.position", "to": "to: sheath.gripper_position", "at": "at: 5 s",
    "signal": "signal: sensor.force", "reduce": "reduce: std", "title": "title: Contact force",
}  # fmt: skip

KINDS = {
    "string_type": "text",
    "list_type": "a list",
    "dict_type": "a group of `key: value` lines",
    "model_type": "a group of `key: value` lines",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
}


def validate(root: Node) -> tuple[ScenarioKeys, Node, list[str]]:
    """The scenario's keys, the tree they were read from, and every problem found.

    What is wrong is left out of keys and tree, so that names and units in the rest can be checked in the same run.
    """
    problems: list[str] = []
    for attempt in range(12):
        try:
            return ScenarioKeys.model_validate(root.plain()), root, problems
        except ValidationError as error:
            found = error.errors(include_url=False)
            if attempt == 0:
                problems += [line(root, one) for one in found]
            # from the last one backwards: an item that leaves its list does not move those still to be dropped
            for path in reversed(
                dict.fromkeys(one["loc"][: -1 if one["type"] == "missing" else None] for one in found)
            ):
                root = dropped(root, path)
    return ScenarioKeys(), Node({}, root.place), problems


def dropped(node: Node, path: Path) -> Node:
    """The tree without what is at a path."""
    if not path:
        return node
    first, *rest = path
    if isinstance(node.value, dict) and first in node.value:
        entries = dict(node.value)
        kept = rest not in ([], ["[key]"])
        entries = {k: dropped(v, tuple(rest)) if k == first else v for k, v in entries.items() if kept or k != first}
        return Node(entries, node.place)
    if isinstance(node.value, list) and isinstance(first, int) and first < len(node.value):
        items = list(node.value)
        items[first : first + 1] = [dropped(items[first], tuple(rest))] if rest else []
        return Node(items, node.place)
    return node


def line(root: Node, error: Any) -> str:
    """One problem as one line."""
    path: Path = tuple(step for step in error["loc"] if step != "[key]")
    place = root.find(path).place
    what = dotted(path)
    kind, given = error["type"], error["input"]
    if kind == "extra_forbidden":
        outer = f"{dotted(path[:-1])}: " if path[:-1] else ""
        return f"{place}: {outer}unknown key `{path[-1]}`.{nearest(str(path[-1]), keys_at(path[:-1]))}"
    if kind == "missing":
        example = EXAMPLES.get(str(path[-1]), f"{path[-1]}: ...")
        return f"{place}: {dotted(path[:-1])}: `{path[-1]}` is missing. Add it, such as `{example}`."
    if kind == "value_error":
        return f"{place}: {what}: {error['msg'].removeprefix('Value error, ').rstrip('.')}."
    if kind == "literal_error":
        choices = error["ctx"]["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        return f"{place}: {what}: `{short(given)}` is not known.{nearest(str(given), choices)}"
    if kind in KINDS:
        return f"{place}: {what}: expected {KINDS[kind]}, not {quoted(given)}."
    return f"{place}: {what}: {error['msg'][0].lower()}{error['msg'][1:]}, not {quoted(given)}."


def quoted(value: Any) -> str:
    """A value for a message, text in backquotes."""
    return f"`{short(value)}`" if isinstance(value, str) else short(value)


def dotted(path: Path) -> str:
    """`metrics.force.reduce`; items of lists by their number: `events[2].at`."""
    text = ""
    for step in path:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}"
    return text.removeprefix(".")


def keys_at(path: Path) -> list[str]:
    """The keys that a group may have."""
    model: Any = ScenarioKeys
    for step in path:
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            continue
        fields = {field.alias or name: field.annotation for name, field in model.model_fields.items()}
        model = inner(fields.get(str(step))) or model  # a name or a number in between: the group is the same
    return [field.alias or name for name, field in model.model_fields.items()]


def inner(annotation: Any) -> Any:
    """The model inside `dict[str, Model]`, `list[Model]` or `Model | None`, or `dict` steps in between."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        if (found := inner(argument)) is not None:
            return found
    return None
