"""`--set path=value`: patches from the command line, in force in every variant.

An option is applied to the base and to each variant that says something about the same member or key, so that what
the person at the terminal asked for is never undone by a variant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.scenario import yaml_reader
from twin.scenario.merge import RHYTHM, members, merged
from twin.scenario.variable_names import nearest
from twin.scenario.yaml_node import Node, Place

if TYPE_CHECKING:
    from collections.abc import Iterable

TOP_LEVEL = ("start_time", "stop_time", "step", "algorithm", "seed", "seeds", "title", "source")


def overridden(root: Node, options: Iterable[str]) -> tuple[Node, list[str], list[str]]:
    """(tree with `--set` options applied, those that changed something, problems)."""
    effective, problems = [], []
    for option in options:
        try:
            changed = override(root, option)
        except ScenarioError as error:
            problems += error.problems
            continue
        if changed.plain() != root.plain():
            effective.append(option)
        root = changed
    return root, effective, problems


def override(root: Node, option: str) -> Node:
    """One `path=value` applied to the base and to every variant that says something about the same thing."""
    shown = f"--set {option}"
    path, equals, text = option.partition("=")
    path = path.strip()
    if not equals or not path or not text.strip():
        raise ScenarioError(f'{shown}: expected path=value, such as --set heart.rate="1.4 Hz" or --set step="1 ms".')
    value = option_value(text.strip(), shown)
    variants = root.entries["variants"].entries if "variants" in root.entries else {}
    only = next(
        (name for name in sorted(variants, key=len, reverse=True) if path.startswith(f"variants.{name}.")), None
    )
    if only is None and path.startswith("variants."):
        raise ScenarioError(f"{shown}: there is no such variant.{nearest(path.split('.')[1], variants)}")
    path = path.removeprefix(f"variants.{only}.") if only else path
    patch = option_patch(path, value, shown)
    name = path.partition(".")[0]
    is_member = "." in path and name != "algorithm"
    if is_member and name not in members(root).keys() | {m for variant in variants.values() for m in members(variant)}:
        known = [*members(root), *TOP_LEVEL]
        raise ScenarioError(f"{shown}: there is no member `{name}`.{nearest(name, known)}")
    if only:
        return merged(root, wrapped({"variants": wrapped({only: patch}, shown)}, shown))
    affected = {}
    for variant, node in variants.items():
        says = members(node)[name].value is not None if is_member and name in members(node) else name in node.entries
        if says:
            affected[variant] = patch
    if affected:
        root = merged(root, wrapped({"variants": wrapped(affected, shown)}, shown))
    return merged(root, patch) if not is_member or name in members(root) else root


def wrapped(entries: dict[str, Node], shown: str) -> Node:
    """A dict of an option."""
    return Node(entries, Place(shown))


def option_value(text: str, shown: str) -> Node:
    """Value of an option, as it would be read after the colon in a file; `1, 2, 3` is a list."""
    if "," in text and not text.startswith("["):
        text = f"[{text}]"

    def at_option(node: Node) -> Node:
        if isinstance(node.value, dict):
            raise ScenarioError(f"{shown}: expected a value or a list of values after the equals sign.")
        value = [at_option(item) for item in node.value] if isinstance(node.value, list) else node.value
        return Node(value, Place(shown))

    try:
        parsed = yaml_reader.parse(text, shown)
    except ScenarioError:
        raise ScenarioError(f"{shown}: the value cannot be read. Write it like 1.4 Hz, true or [1, 2, 3].") from None
    return at_option(parsed)


def option_patch(path: str, value: Node, shown: str) -> Node:
    """The patch that an option stands for."""
    name, dot, rest = path.partition(".")
    if name == "algorithm" and dot:
        return wrapped({name: wrapped({rest: value}, shown)}, shown)
    if not dot:
        if name not in TOP_LEVEL:
            hint = nearest(name, TOP_LEVEL)
            raise ScenarioError(f"{shown}: `{name}` cannot be set. Give member.parameter or a key of the run.{hint}")
        if name in ("seed", "seeds"):
            name, value = "seeds", value if isinstance(value.value, list) else Node([value], value.place)
        return wrapped({name: value}, shown)
    if rest in ("component", *RHYTHM, "finite", "isolate", "interface", "solver", "solver_tolerance"):
        member = wrapped({rest: value}, shown)
    else:
        member = wrapped({"parameters": wrapped({rest.removeprefix("parameters."): value}, shown)}, shown)
    return wrapped({"members": wrapped({name: member}, shown)}, shown)
