"""Variants of the file that a scenario extends: removal of some, and settings of the extending file that others undo."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from twin.errors import printable
from twin.scenario.resolution.variable_names import nearest
from twin.scenario.yaml_files.member_removal import members
from twin.scenario.yaml_files.yaml_node import Node

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

TIMING_KEYS = ("period", "communication_step")  # keys of a member that do not depend on its component
RUN_KEYS = ("stop_time", "step", "algorithm")  # keys of a variant besides its system
SECTIONS = {  # whose entries name variants: singular and plural of an entry
    "metrics": ("metric", "metrics"),
    "expect": ("expectation", "expectations"),
    "analyses": ("analysis", "analyses"),
    "plots": ("plot", "plots"),
    "scenes": ("scene", "scenes"),
    "console": ("control", "controls"),
}


def variants(root: Node) -> dict[str, Node]:
    """Return the variants of a scenario."""
    return root.get("variants").entries


def keep_empty_variants(root: Node) -> Node:
    """Return a scenario that extends no file, in which a variant without a value is one without changes."""
    if not any(node.value is None for node in variants(root).values()):
        return root
    return root | {"variants": root.get("variants").map(lambda node: node if node.value is not None else node | {})}


def remove_variants(base: Node, root: Node, problems: list[str]) -> Node:
    """Return the extended file without the variants that `root` sets to null, and without what names only these.

    A note says how much that is; an unknown name is appended to `problems`.
    """
    removed = {name: node for name, node in variants(root).items() if node.value is None}
    problems += [
        f"{node.location}: there is no variant `{name}` to remove.{nearest(name, variants(base))} An unchanged variant is `{name}: {{}}`."
        for name, node in removed.items()
        if name not in variants(base)
    ]
    if not removed:
        return base
    entries = dict(base.entries)
    lost_metrics: set[str] = set()
    texts = []
    for section, nouns in SECTIONS.items():
        if section not in entries or (section in root.entries and not root.entries[section].entries):
            continue  # the extending file replaces it
        before = entries[section]
        entries[section] = after = reduced_section(section, before, removed, lost_metrics)
        if number := count(before) - count(after):
            texts.append(f"{number} {nouns[number > 1]}")
        if section == "metrics":
            lost_metrics = before.entries.keys() - after.entries.keys()
    if texts:
        where = next(iter(removed.values())).location
        note(f"{where}: left out with {', '.join(removed)}: {', '.join(texts)}, naming no other variant.")
    return Node(entries, base.location)


def count(section: Node) -> int:
    """Return the number of entries of a section."""
    if "controls" in section.entries:
        return len(section.entries["controls"].items)
    return len(section.entries or section.items)


def reduced_section(section: str, node: Node, removed: Mapping[str, Node], lost_metrics: set[str]) -> Node:
    """Return a section without its entries that name only removed variants or a lost metric."""
    if section == "console":
        controls = node.entries.get("controls")
        return node if controls is None else node | {"controls": reduced_section("", controls, removed, lost_metrics)}
    return node.map(lambda item: reduced(item, removed, lost_metrics))


def reduced(item: Node, removed: Mapping[str, Node], lost_metrics: set[str]) -> Node | None:
    """Return an entry without removed variants; None if no variant, or no two of an order, or no metric is left."""
    entries = dict(item.entries)
    if item.get("metric").value in lost_metrics:
        return None
    for key, least in {"variants": 1, "ordered": 2, "except": 0}.items():
        if key not in entries:
            continue
        names = entries[key].items if isinstance(entries[key].value, list) else [entries[key]]
        rest = [name for name in names if name.value not in removed]
        if len(rest) < min(least, len(names)):
            return None
        if len(rest) < len(names):
            entries[key] = Node(rest, entries[key].location)
    if item.get("reference").entries:
        entries["reference"] = item.get("reference").without(*removed)
        if not entries["reference"].entries:
            del entries["reference"]
            entries.pop("tolerance", None)
    return Node(entries, item.location) if item.entries else item


def note_undone(root: Node, base: Node) -> None:
    """Log a note for each member and key that an extending file sets and inherited variants set otherwise."""
    own = variants(root)
    inherited = {name: node for name, node in variants(base).items() if name not in own or own[name].value is not None}
    for name, patch in members(root).items():
        component = (patch if "component" in patch.entries else base.get("members").get(name)).get("component").value
        undone: dict[str, list[str]] = {}
        for variant, node in inherited.items():
            if name in root.get("variants").get(variant).get("members").entries:
                continue  # the extending file says what holds in the variant
            for path in undone_paths(patch, node.get("members").get(name), component):
                undone.setdefault(".".join((name, *path)), []).append(variant)
        if undone:
            names = list(dict.fromkeys(variant for each in undone.values() for variant in each))
            where = members(inherited[names[0]])[name].location
            report_undone(patch, list(undone), names, f"{name} ({where})", f"members: {{{name}: ...}}")
    for key in RUN_KEYS:
        names = [
            variant
            for variant, node in inherited.items()
            if key in root.entries and key in node.entries and key not in root.get("variants").get(variant).entries
            if node.get(key).plain() != root.get(key).plain()
        ]
        if names:
            where = inherited[names[0]].get(key).location
            report_undone(root.get(key), [key], names, f"{key} ({where})", f"{key}: ...")


def note_replaced_expectations(root: Node, base: Node, name: str) -> None:
    """Log a note if expectations of a file replace those of the file that it extends; an empty list removes them on purpose."""
    lost, own = len(base.get("expect").items), root.get("expect")
    if lost and own.value:
        what = "the expectation" if lost == 1 else f"all {lost} expectations"
        note(f"{own.location}: expect: replaces {what} of {name}. Copy those that should hold here too.")


def undone_paths(patch: Node, variant_member: Node, component: Any) -> Iterator[tuple[str, ...]]:
    """Yield the keys and parameters of a member's patch that a variant's own patch of the member replaces."""
    is_replaced = variant_member.get("component").value not in (None, component)
    for key, node in patch.entries.items():
        if key == "parameters":
            own_values = variant_member.get("parameters").entries
            for parameter, value in node.entries.items():
                if is_replaced or (parameter in own_values and own_values[parameter].plain() != value.plain()):
                    yield (parameter,)
        elif key in variant_member.entries:
            if variant_member.get(key).plain() != node.plain():
                yield (key,)
        elif is_replaced and key not in TIMING_KEYS:
            yield (key,)


def report_undone(patch: Node, paths: Sequence[str], names: Sequence[str], own: str, example: str) -> None:
    """Log that settings have no effect in variants, and how to set them there."""
    others = f" and {len(names) - 1} more" * (len(names) > 1)
    text = f"{patch.location}: {', '.join(paths)}: no effect in {names[0]}{others}, with {'its' if len(names) == 1 else 'their'} own {own}. "
    note(f"{text}Set it there too: `variants: {{{names[0]}: {{{example}}}}}`, or with --set in all.")


def note(text: str) -> None:
    """Log a note for the user."""
    logging.getLogger("twin").warning(printable(f"note: {text}"))
