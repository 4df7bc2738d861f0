"""`--set path=value`: patches from the command line, in force in every variant.

An option is applied to the base and to each variant that sets the same member or key, so that a variant never undoes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.scenario.resolution.variable_names import nearest
from twin.scenario.yaml_files import yaml_reader
from twin.scenario.yaml_files.inherited_variants import TIMING_KEYS
from twin.scenario.yaml_files.member_removal import members
from twin.scenario.yaml_files.merge import merged
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

TOP_LEVEL = ("start_time", "stop_time", "step", "algorithm", "threads", "seed", "seeds", "title", "source")


def overridden(root: Node, options: Iterable[str]) -> tuple[Node, list[str], list[str]]:
    """Apply `--set` options: (tree, options that changed it, problems)."""
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
    """Apply one `path=value` to the base and to every variant that sets the same member or key."""
    path, value = parse_option(option)
    shown = str(value.location)
    variants = root.get("variants").entries
    only_variant = next(
        (name for name in sorted(variants, key=len, reverse=True) if path.startswith(f"variants.{name}.")), None
    )
    if only_variant is None and path.startswith("variants."):
        raise ScenarioError(f"{shown}: there is no such variant.{nearest(path.split('.')[1], variants)}")
    path = path.removeprefix(f"variants.{only_variant}.") if only_variant else path
    patch = option_patch(path, value)
    name = path.partition(".")[0]
    is_member = "." in path and name != "algorithm"
    if is_member and name not in members(root).keys() | {m for variant in variants.values() for m in members(variant)}:
        candidates = [*members(root), *TOP_LEVEL]
        raise ScenarioError(f"{shown}: there is no member `{name}`.{nearest(name, candidates)}")
    if only_variant:
        return merged(root, patch.under("variants", only_variant))
    for variant, node in variants.items():
        is_affected = (
            members(node)[name].value is not None if is_member and name in members(node) else name in node.entries
        )
        if is_affected:
            root = merged(root, patch.under("variants", variant))
    return merged(root, patch) if not is_member or name in members(root) else root


def replaced_values(root: Node, options: Iterable[str], variants: Collection[str]) -> list[str]:
    """Return a sentence for each `--set` option that replaces values which some of `variants` set themselves, or is of a variant that is not run."""
    nodes = root.get("variants").entries
    sentences = []
    for option in options:
        path, value = parse_option(option)
        only = max((name for name in nodes if path.startswith(f"variants.{name}.")), key=len, default=None)
        if only is not None and only not in variants:
            sentences.append(f"--set {option}: {only} is not run: no effect.")
        own_values = [
            f"{variant} ({own.plain()})"
            for variant, node in nodes.items()
            for key in option_keys(path)
            if variant in variants and has_path(node, key) and (own := node.find(key)).plain() != value.plain()
        ]
        if own_values:
            sentences.append(f"--set {option} also replaces what variants set themselves: {', '.join(own_values)}.")
    return sentences


def previous_values(root: Node, options: Iterable[str]) -> list[str]:
    """Return for each `--set` option the value that it replaces in the file; empty if the file sets none."""
    values = []
    for option in options:
        path, _ = parse_option(option)
        own = (root.find(key).plain() for key in option_keys(path) if has_path(root, key))
        values.append(str(next(own, "")))
    return values


def option_keys(path: str) -> set[tuple[str, ...]]:
    """Return the keys at which a file may have the value of an option."""
    name, _, rest = path.partition(".")
    return {(path,), ("members", name, rest), ("members", name, "parameters", rest.removeprefix("parameters."))}


def has_path(node: Node, path: tuple[str, ...]) -> bool:
    """Whether a tree has a node at a path of keys."""
    for key in path:
        if key not in node.entries:
            return False
        node = node.entries[key]
    return True


def parse_option(option: str) -> tuple[str, Node]:
    """Split `path=value` into the path and the value; ScenarioError for another text."""
    shown = f"--set {option}"
    path, equals, text = option.partition("=")
    if not equals or not path.strip() or not text.strip():
        raise ScenarioError(f'{shown}: expected path=value, such as --set heart.rate="1.4 Hz" or --set step="1 ms".')
    return path.strip(), option_value(text.strip(), shown)


def option_value(text: str, shown: str) -> Node:
    """Parse the value of an option like a YAML value; `1, 2, 3` is a list."""
    if "," in text and not text.startswith("["):
        text = f"[{text}]"

    def at_option(node: Node) -> Node:
        if isinstance(node.value, dict):
            raise ScenarioError(f"{shown}: expected a value or a list of values after the equals sign.")
        value = [at_option(item) for item in node.value] if isinstance(node.value, list) else node.value
        return Node(value, SourceLocation(shown))

    try:
        parsed = yaml_reader.parse(text, shown)
    except ScenarioError:
        raise ScenarioError(f"{shown}: the value cannot be read. Write it like 1.4 Hz, true or [4 mm, 2 mm].") from None
    return at_option(parsed)


def option_patch(path: str, value: Node) -> Node:
    """Create the patch of an option."""
    name, dot, rest = path.partition(".")
    if name == "algorithm" and dot:
        return value.under(name, rest)
    if not dot:
        if name not in TOP_LEVEL:
            hint = nearest(name, TOP_LEVEL)
            raise ScenarioError(
                f"{value.location}: `{name}` cannot be set. Give member.parameter or a key of the run.{hint}"
            )
        if name in ("seed", "seeds"):
            name, value = "seeds", value if isinstance(value.value, list) else Node([value], value.location)
        return value.under(name)
    if rest in ("component", *TIMING_KEYS, "finite", "isolate", "interface", "solver", "solver_tolerance"):
        return value.under("members", name, rest)
    return value.under("members", name, "parameters", rest.removeprefix("parameters."))
