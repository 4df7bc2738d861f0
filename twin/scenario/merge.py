"""Scenarios over scenarios: `extends`, `variants` and `--set` are all patches of one tree by the same rules.

A dict is merged key by key, and `null` removes what was there. A member that names another component replaces the
old one with its parameters, and keeps its period and communication step. Connections are merged by target (`{from: null, to: x}` disconnects), events are added
(`events: null` first drops those inherited). Every other list is replaced.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.scenario import ssp_reader, yaml_reader
from twin.scenario.variable_names import nearest
from twin.scenario.yaml_node import Node
from twin.scene import READERS

if TYPE_CHECKING:
    from collections.abc import Callable

Keys = tuple[str, ...]

RHYTHM = ("period", "communication_step")  # of a member, whatever its component is
DEEPEST = 50  # files that extend each other
OWN = ("mutations",)  # what was found out about one file's expectations says nothing of those that extend it
IDENTIFIED = "identified"  # in the file of a parameter set: how `twin identify` found it, which is no component


def load(path: Path, shown: str, problems: list[str], above: tuple[Path, ...] = ()) -> Node:
    """A file merged over those it extends, paths of FMUs made absolute, connections in their normal form.

    What is wrong and does not keep it from being read goes to `problems`.
    """
    read = ssp_reader.read if path.suffix == ssp_reader.SUFFIX and path.is_file() else yaml_reader.read
    return complete(read(path, shown, problems), path, shown, problems, above)


def complete(root: Node, path: Path, shown: str, problems: list[str], above: tuple[Path, ...] = ()) -> Node:
    """The same for a tree that stands for the file `path`."""
    own = path.resolve()
    if not isinstance(root.value, dict):
        raise ScenarioError(f"{root.place}: a scenario is a list of `key: value` lines. Begin with `members:`.")
    root = normal(root, own.parent, problems)
    parent = root.entries.get("extends")
    if parent is None or parent.value is None:
        problems += strays(root, root) + idle(root, None)
        return merged(Node({}, root.place), root)
    if not isinstance(parent.value, str):
        raise ScenarioError(f"{parent.place}: extends: expected the path of one scenario, such as contact.yaml.")
    target = path.parent / parent.value
    if target.resolve() in (own, *above):
        raise ScenarioError(f"{parent.place}: extends: {parent.value} extends this file again. Break the circle.")
    if len(above) >= DEEPEST:
        raise ScenarioError(f"{parent.place}: extends: more than {DEEPEST} files extend each other. Join some of them.")
    if not target.is_file():
        known = [other.name for other in target.parent.glob("*.y*ml")] if target.parent.is_dir() else []
        hint = nearest(target.name, known) or " Give a path relative to this file."
        raise ScenarioError(f"{parent.place}: extends: there is no file {parent.value}.{hint}")
    base = load(target, str(Path(shown).parent / parent.value), problems, (own, *above))
    base = Node({key: node for key, node in base.entries.items() if key not in OWN}, base.place)
    problems += strays(root, base) + idle(root, base)
    result = merged(base, root)
    return Node({key: node for key, node in result.entries.items() if key != "extends"}, root.place)


def normal(root: Node, folder: Path, problems: list[str]) -> Node:
    """The tree with one `{from, to}` per connection and absolute paths of FMUs, also in its variants."""
    entries = dict(root.entries)
    if "seed" in entries and "seeds" not in entries:
        node = entries.pop("seed")
        entries["seeds"] = Node([node] if node.value is not None else None, node.place)
    for key, node in entries.items():
        if key == "connections" and isinstance(node.value, list):
            entries[key] = Node([one for item in node.items for one in connections(item)], node.place)
        elif key == "record" and isinstance(node.value, list):
            entries[key] = Node({"variables": node}, node.place)
        elif key == "parameter_sets":
            items = node.items if isinstance(node.value, list) else [node]
            entries[key] = Node([parameter_set(item, folder, problems) for item in items], node.place)
        elif key == "scenes" and isinstance(node.value, list):
            entries[key] = Node([scene(item, folder) for item in node.items], node.place)
        elif key == "members" and isinstance(node.value, dict):
            entries[key] = Node({name: located(item, folder) for name, item in node.entries.items()}, node.place)
        elif key == "variants" and isinstance(node.value, dict):
            entries[key] = Node(
                {name: normal(item, folder, problems) for name, item in node.entries.items()}, node.place
            )
    return Node(entries, root.place) if isinstance(root.value, dict) else root


def scene(item: Node, folder: Path) -> Node:
    """A scene whose environment, if it is a file, has an absolute path."""
    node = item.entries.get("environment")
    if node is None or not isinstance(node.value, str) or Path(node.value).suffix not in READERS:
        return item
    return Node(item.entries | {"environment": Node(str((folder / node.value).resolve()), node.place)}, item.place)


def parameter_set(item: Node, folder: Path, problems: list[str]) -> Node:
    """A parameter set's content, `component: {parameter: value}`, if its file is named."""
    if not isinstance(item.value, str):
        return item
    path = folder / item.value
    if not path.is_file():
        known = [other.name for other in path.parent.glob("*.y*ml")] if path.parent.is_dir() else []
        hint = nearest(path.name, known) or " Give a path relative to this file."
        problems.append(f"{item.place}: parameter_sets: there is no file {item.value}.{hint}")
        return Node({}, item.place)
    try:
        content = yaml_reader.read(path, str(Path(item.place.file).parent / item.value), problems)
    except ScenarioError as error:
        problems += error.problems
        return Node({}, item.place)
    if not isinstance(content.value, dict):
        return content
    own = {located_name(name, path.parent): one for name, one in content.entries.items() if name != IDENTIFIED}
    return Node(own, content.place)


def located(member: Node, folder: Path) -> Node:
    """A member whose component, if it is the path of an FMU or of a scenario's group, is absolute."""
    component = member.entries.get("component")
    if component is None or not isinstance(component.value, str):
        return member
    absolute = Node(located_name(component.value, folder), component.place)
    return Node(member.entries | {"component": absolute}, member.place)


def located_name(component: str, folder: Path) -> str:
    """A component's name; absolute if it is the path of an FMU, of a table or of a scenario's group."""
    path, mark, group = component.partition("#")
    if not path.endswith((".yaml", ".yml") if mark else (".fmu", ".csv")):
        return component
    return f"{(folder / path).resolve()}{mark}{group}"


def connections(item: Node) -> list[Node]:
    """`a -> b, c` and `{from: a, to: [b, c]}` as one node for each target; anything else unchanged."""
    if isinstance(item.value, str):
        source, arrow, targets = item.value.partition("->")
        if not arrow:
            return [item]
        parts = [part.strip() for part in targets.split(",")]
        start = Node(source.strip(), item.place)
        return [Node({"from": start, "to": Node(part, item.place)}, item.place) for part in parts]
    target = item.entries.get("to")
    if target is None or not isinstance(target.value, list):
        return [item]
    return [Node(item.entries | {"to": Node(one.value, one.place)}, item.place) for one in target.items]


def strays(root: Node, base: Node) -> list[str]:
    """What a file disconnects of members that neither it nor the one it extends has, in any variant."""
    empty = Node({}, root.place)
    patches = [one for file in (root, base) for one in (file, *file.entries.get("variants", empty).entries.values())]
    known = owners(root, base)
    return [
        f"{item.entries['to'].place}: there is no member `{owner}`.{nearest(owner, known)}"
        for one in patches
        for item in written_connections(one)
        if disconnects(item) and (owner := (target(item) or "").partition(".")[0]) and owner not in known
    ]


def idle(root: Node, above: Node | None) -> list[str]:
    """What a file disconnects of the one above it, or a variant of its file, that nothing of this name connects."""
    empty = Node({}, root.place)
    base = above or empty
    ends = {target(item) for item in written_connections(base)}
    found = [(item, ends) for item in written_connections(root) if above is not None]
    ends = ends | {target(item) for item in written_connections(root) if not disconnects(item)}
    inherited = base.entries.get("variants", empty).entries
    for name, variant in root.entries.get("variants", empty).entries.items():
        own = ends | {target(item) for item in written_connections(inherited.get(name, empty))}
        found += [(item, own) for item in written_connections(variant)]
    return [
        f"{item.entries['to'].place}: nothing is connected to `{end}` under this name.{nearest(end, filter(None, known))} Write what "
        f"stands behind `->` in the connection that is to go, the terminal's name if it connects terminals."
        for item, known in found
        if disconnects(item)
        and (end := target(item))
        and end not in known
        and end.partition(".")[0] in owners(root, base)
    ]


def owners(*files: Node) -> set[str]:
    """Members of files, in any variant."""
    variants = [one for file in files for one in file.entries.get("variants", Node({}, file.place)).entries.values()]
    return {name for one in (*files, *variants) for name in members(one)}


def written_connections(root: Node) -> list[Node]:
    """The connections that a scenario or variant writes."""
    node = root.entries.get("connections") if isinstance(root.value, dict) else None
    return list(node.items) if node is not None else []


def disconnects(connection: Node) -> bool:
    """Whether it is `{from: null, to: x}`."""
    return "from" in connection.entries and connection.entries["from"].value is None


def merged(base: Node, patch: Node, path: Keys = (), keep_null: bool = False) -> Node:
    """`patch` over `base`. `keep_null`: both are patches themselves, so that a `null` is still to be applied."""
    if not isinstance(patch.value, dict):
        return merged_list(base, patch, path, keep_null) if isinstance(patch.value, list) else patch
    if path == ("algorithm",):
        named = Node({"name": base}, base.place) if isinstance(base.value, str) else base
        base = Node({}, patch.place) if "name" in patch.entries else named
    if len(path) == 2 and path[0] == "members" and replaces(base, patch):
        base = Node({key: base.entries[key] for key in RHYTHM if key in base.entries}, patch.place)
    if not path and not keep_null:
        base = without(base, [name for name, node in members(patch).items() if node.value is None])
    entries = dict(base.entries)
    for key, node in patch.entries.items():
        if node.value is None and not keep_null:
            entries.pop(key, None)
            continue
        before = entries.get(key, Node(None, node.place))
        below = () if path == ("variants",) else (*path, key)
        entries[key] = merged(before, node, below, keep_null or path == ("variants",))
    return Node(entries, base.place if base.entries else patch.place)


def merged_list(base: Node, patch: Node, path: Keys, keep_null: bool) -> Node:
    """Events are added, connections replace those into the same target, any other list replaces the old one."""
    if path == ("events",):
        return Node(base.items + patch.items, patch.place)
    if path != ("connections",):
        return patch
    targets = {target(item) for item in patch.items} - {None}
    kept = [item for item in base.items if target(item) not in targets]
    added = [item for item in patch.items if keep_null or not disconnects(item)]
    return Node(kept + added, patch.place)


def target(connection: Node) -> str | None:
    """Where a connection in normal form ends, if it is well formed."""
    node = connection.entries.get("to")
    return node.value if node is not None and isinstance(node.value, str) else None


def members(root: Node) -> dict[str, Node]:
    """The members of a scenario or variant."""
    return root.entries["members"].entries if "members" in root.entries else {}


def replaces(base: Node, patch: Node) -> bool:
    """Whether a member's patch names another component than it had: then the old parameters mean nothing."""
    new, old = patch.entries.get("component"), base.entries.get("component")
    return new is not None and old is not None and new.value != old.value


def without(root: Node, names: list[str]) -> Node:
    """The scenario without some members: their connections and events go with them."""
    if not names:
        return root
    entries = dict(root.entries)

    def gone(reference: object) -> bool:
        return isinstance(reference, str) and reference.partition(".")[0] in names

    if "connections" in entries:
        node = entries["connections"]
        ends = [
            (item, [end.value for key, end in item.entries.items() if key in ("from", "to")]) for item in node.items
        ]
        entries["connections"] = Node([item for item, both in ends if not any(map(gone, both))], node.place)
    if "events" in entries:
        node = entries["events"]
        entries["events"] = Node([event for item in node.items for event in kept_event(item, gone)], node.place)
    return Node(entries, root.place)


def kept_event(event: Node, gone: Callable[[object], bool]) -> list[Node]:
    """The event without what it does to members that are gone; nothing if that was all."""
    if "fault" in event.entries:
        return [] if "node" in event.entries and gone(event.entries["node"].value) else [event]
    entries: dict[str, Node] = {}
    for key, node in event.entries.items():
        if isinstance(node.value, dict):
            node = Node({name: value for name, value in node.entries.items() if not gone(name)}, node.place)  # noqa: PLW2901
        elif isinstance(node.value, list):
            node = Node([item for item in node.items if not gone(item.value)], node.place)  # noqa: PLW2901
        elif gone(node.value):
            continue
        if key == "at" or node.value:
            entries[key] = node
    return [Node(entries, event.place)] if set(entries) - {"at"} else []


def variant_trees(root: Node) -> dict[str, Node]:
    """Each variant's full tree in the order of the file; `base` is the only one if there are no variants."""
    base = Node({key: node for key, node in root.entries.items() if key != "variants"}, root.place)
    variants = root.entries["variants"].entries if "variants" in root.entries else {}
    if not variants:
        return {"base": parametrized(base)}
    return {
        name: parametrized(merged(base, patch if isinstance(patch.value, dict) else Node({}, patch.place)))
        for name, patch in variants.items()
    }


def parametrized(root: Node) -> Node:
    """The tree with the parameter sets put under what its members say themselves; later sets over earlier ones."""
    sets = root.entries["parameter_sets"].items if "parameter_sets" in root.entries else []
    own = members(root)
    for one in reversed(sets):
        for name, member in own.items():
            component = member.entries.get("component")
            below = one.entries.get(component.value) if component and isinstance(component.value, str) else None
            if below is not None and isinstance(below.value, dict):
                above = member.entries.get("parameters", Node({}, member.place))
                own = own | {name: Node(member.entries | {"parameters": merged(below, above)}, member.place)}
    if not own:
        return root
    return Node(root.entries | {"members": Node(own, root.entries["members"].place)}, root.place)
