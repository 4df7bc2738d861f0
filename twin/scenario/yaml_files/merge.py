"""Merge rules of scenarios: `extends`, `variants` and `--set` are patches of one tree by the same rules.

A dict is merged key by key, and `null` removes what was there. A member that names another component replaces the
old one with its parameters, and keeps its period and communication step. Connections are merged by target (`{from: null, to: x}` disconnects), events are added
(`events: null` first drops those inherited). Every other list is replaced.
"""

from __future__ import annotations

import logging
from functools import partial
from pathlib import Path

from twin.errors import ScenarioError, printable, suggestion
from twin.scenario import fmu_reader, scenario_paths, ssp_reader
from twin.scenario.resolution.variable_names import nearest
from twin.scenario.yaml_files import yaml_reader
from twin.scenario.yaml_files.inherited_variants import (
    TIMING_KEYS,
    keep_empty_variants,
    note_replaced_expectations,
    note_undone,
    remove_variants,
)
from twin.scenario.yaml_files.member_removal import members, remove_members
from twin.scenario.yaml_files.yaml_node import Node

Keys = tuple[str, ...]

FORMER_KEYS = {"paper": "reference"}  # of a metric
MAX_DEPTH = 50  # levels of `extends`
NOT_INHERITED = ("mutations", "summary", "topic")  # valid only for the file that contains it
OTHER_FILES = {  # key of a file that is no scenario: what the file is
    "vary": "a study. Run it with `twin study`",
    "samples": "a study. Run it with `twin study`",
    "fit": "a description for `twin identify`. Run it with that",
    "nodes": "a hardware file. Name it with --hardware",
}
IDENTIFIED = "identified"  # record of `twin identify` in a parameter set's file; not a component


def load(path: Path, shown: str, problems: list[str], extending_files: tuple[Path, ...] = ()) -> Node:
    """Load a file merged over those it extends, with absolute paths of FMUs and normalized connections.

    Problems that do not prevent reading are appended to `problems`.
    """
    is_fmu = path.suffix == fmu_reader.SUFFIX and path.is_file()
    read = fmu_reader.read if is_fmu else ssp_reader.read if ssp_reader.is_package(path) else yaml_reader.read
    return complete(read(path, shown, problems), path, shown, problems, extending_files)


def complete(root: Node, path: Path, shown: str, problems: list[str], extending_files: tuple[Path, ...] = ()) -> Node:
    """Normalize a tree of the file `path` and merge it over the files it extends."""
    resolved_path = path.resolve()
    if not isinstance(root.value, dict):
        raise ScenarioError(f"{root.location}: a scenario is a list of `key: value` lines. Begin with `members:`.")
    for key, what in OTHER_FILES.items():
        if key in root.entries and "members" not in root.entries:
            raise ScenarioError(f"{root.entries[key].location}: this file is no scenario but {what}.")
    root = normalize(root, resolved_path.parent, problems)
    parent = root.get("extends")
    if parent.value is None:
        problems += unknown_disconnects(root, root) + unused_disconnects(root, None)
        return merged(Node({}, root.location), keep_empty_variants(root))
    if not isinstance(parent.value, str):
        raise ScenarioError(f"{parent.location}: extends: expected the path of one scenario, such as contact.yaml.")
    target = extended_file(path, parent.value)
    if target.resolve() in (resolved_path, *extending_files):
        raise ScenarioError(f"{parent.location}: extends: {parent.value} extends this file again. Break the circle.")
    if len(extending_files) >= MAX_DEPTH:
        raise ScenarioError(
            f"{parent.location}: extends: more than {MAX_DEPTH} files extend each other. Join some of them."
        )
    if not target.is_file():
        what = "file" if target.suffix else "scenario or file"
        names = [other.stem for other in path.parent.glob("*.yaml") if other.name != path.name]
        if target.parent.resolve() == path.parent.resolve():
            hint = suggestion(target.stem, [*names, *scenario_paths.scenarios()], "`")
        else:
            hint = suggestion(target.name, (other.name for other in target.parent.glob("*.y*ml")), "`")
        hint = f" {hint or 'Give the name of a shipped scenario, or a path relative to this file.'}"
        if Path(parent.value).stem in scenario_paths.scenarios():
            hint = f" Write `extends: {Path(parent.value).stem}` for the one that came with the project."
        raise ScenarioError(f"{parent.location}: extends: there is no {what} {parent.value}.{hint}")
    is_near = target == path.parent / parent.value
    base_shown = str(Path(shown).parent / parent.value) if is_near else str(target)
    base = load(target, base_shown, problems, (resolved_path, *extending_files))
    base = base.without(*NOT_INHERITED)
    problems += unknown_disconnects(root, base) + unused_disconnects(root, base)
    base = remove_variants(base, root, problems)
    note_undone(root, base)
    if target.parent.resolve() != resolved_path.parent:
        note_replaced_expectations(root, base, parent.value)
    return Node(merged(base, root).without("extends").value, root.location)


def base_tree(path: Path) -> Node | None:
    """Return the tree of the scenario that a file extends; None if it extends none or cannot be read."""
    try:
        parent = yaml_reader.read(path, path.name).get("extends").value
        target = extended_file(path, parent) if isinstance(parent, str) else None
        return load(target, str(target), []) if target is not None else None
    except ScenarioError:
        return None


def extended_file(path: Path, name: str) -> Path:
    """Return the file that `extends` names: a path relative to the file `path`, or a scenario by its name, also with `.yaml`."""
    target = path.parent / name
    neighbor = target.with_suffix(".yaml")
    if target.suffix not in ("", ".yaml") or len(Path(name).parts) != 1 or target.is_file():
        return target
    return neighbor if neighbor.is_file() else scenario_paths.scenarios().get(target.stem, target)


def normalize(root: Node, folder: Path, problems: list[str]) -> Node:
    """Return the tree with one `{from, to}` per connection and absolute paths of FMUs, also in its variants."""
    entries = dict(root.entries)
    if "seed" in entries and "seeds" not in entries:
        node = entries.pop("seed")
        entries["seeds"] = Node([node] if node.value is not None else None, node.location)
    for key, node in entries.items():
        if key == "connections" and isinstance(node.value, list):
            entries[key] = Node([connection for item in node.items for connection in connections(item)], node.location)
        elif key == "record" and isinstance(node.value, list):
            entries[key] = Node({"variables": node}, node.location)
        elif key == "console" and isinstance(node.value, list):
            entries[key] = Node({"controls": node}, node.location)
        elif key == "parameter_sets":
            items = node.items if isinstance(node.value, list) else [node]
            entries[key] = Node([parameter_set(item, folder, problems) for item in items], node.location)
        elif key == "scenes":
            entries[key] = node.map(partial(scene, folder=folder))
        elif key == "metrics":
            entries[key] = rename_former_keys(node)
        elif key == "members":
            entries[key] = node.map(partial(located, folder=folder))
        elif key == "variants":
            entries[key] = node.map(partial(normalize, folder=folder, problems=problems))
    return Node(entries, root.location) if isinstance(root.value, dict) else root


def rename_former_keys(metrics: Node) -> Node:
    """Return metrics with `reference` for the former key `paper`, which is still read for one release, with a note."""
    former = [metric.entries["paper"] for metric in metrics.entries.values() if "paper" in metric.entries]
    if not former:
        return metrics
    note = printable(f"note: {former[0].location}: `paper` is now `reference`; the old key ends with the next release.")
    logging.getLogger("twin").warning(note)

    def renamed(metric: Node) -> Node:
        entries = {FORMER_KEYS.get(key, key): value for key, value in metric.entries.items()}
        return Node(entries, metric.location) if "paper" in metric.entries else metric

    return metrics.map(renamed)


def scene(item: Node, folder: Path) -> Node:
    """Return a scene with the absolute path of its environment file."""
    from twin.scene import READERS

    node = item.get("environment")
    if not isinstance(node.value, str) or Path(node.value).suffix not in READERS:
        return item
    return item | {"environment": Node(str((folder / node.value).resolve()), node.location)}


def parameter_set(item: Node, folder: Path, problems: list[str]) -> Node:
    """Return the content of a parameter set, `component: {parameter: value}`; read from its file if it is a path."""
    if not isinstance(item.value, str):
        return item
    folders = (folder, *scenario_paths.folders("scenario"))  # then as a shipped scenario names it
    path = next((path for root in folders if (path := root / item.value).is_file()), folder / item.value)
    if not path.is_file():
        advice = scenario_paths.missing_file_advice(path)
        problems.append(f"{item.location}: parameter_sets: there is no file {item.value}. {advice}")
        return Node({}, item.location)
    try:
        content = yaml_reader.read(path, str(Path(item.location.file).parent / item.value), problems)
    except ScenarioError as error:
        problems += error.problems
        return Node({}, item.location)
    if not isinstance(content.value, dict):
        return content
    named_components = {
        located_name(name, path.parent): parameters
        for name, parameters in content.entries.items()
        if name != IDENTIFIED
    }
    return Node(named_components, content.location)


def located(member: Node, folder: Path) -> Node:
    """Return a member whose component, if it is a path, is absolute."""
    component = member.get("component")
    if not isinstance(component.value, str):
        return member
    return member | {"component": Node(located_name(component.value, folder), component.location)}


def located_name(component: str, folder: Path) -> str:
    """Return a component's name; absolute if it is the path of an FMU, a table or a scenario's group."""
    path, mark, group = component.partition("#")
    if not path.endswith((".yaml", ".yml") if mark else (".fmu", ".csv")):
        return component
    return f"{(folder / path).resolve()}{mark}{group}"


def connections(item: Node) -> list[Node]:
    """Split `a -> b, c` and `{from: a, to: [b, c]}` into one node per target; return anything else unchanged."""
    if isinstance(item.value, str):
        source, arrow, targets = item.value.partition("->")
        if not arrow:
            return [item]
        parts = [part.strip() for part in targets.split(",")]
        start = Node(source.strip(), item.location)
        return [Node({"from": start, "to": Node(part, item.location)}, item.location) for part in parts]
    target = item.get("to")
    return [item | {"to": end} for end in target.items] if isinstance(target.value, list) else [item]


def unknown_disconnects(root: Node, base: Node) -> list[str]:
    """Report disconnections of members that neither the file nor the one it extends has in any variant."""
    patches = [patch for file in (root, base) for patch in (file, *file.get("variants").entries.values())]
    member_names = owners(root, base)
    return [
        f"{item.get('to').location}: there is no member `{owner}`.{nearest(owner, member_names)}"
        for patch in patches
        for item in connection_nodes(patch)
        if disconnects(item) and (owner := (target(item) or "").partition(".")[0]) and owner not in member_names
    ]


def unused_disconnects(root: Node, base_file: Node | None) -> list[str]:
    """Report disconnections without a matching inherited connection."""
    base = base_file or Node({}, root.location)
    targets = {target(item) for item in connection_nodes(base)}
    candidates = [(item, targets) for item in connection_nodes(root) if base_file is not None]
    targets = targets | {target(item) for item in connection_nodes(root) if not disconnects(item)}
    for name, variant in root.get("variants").entries.items():
        variant_targets = targets | {target(item) for item in connection_nodes(base.get("variants").get(name))}
        candidates += [(item, variant_targets) for item in connection_nodes(variant)]
    return [
        f"{item.entries['to'].location}: nothing is connected to `{end}` under this name.{nearest(end, filter(None, connected_targets))} Write what "
        f"stands behind `->` in the connection that is to go, the terminal's name if it connects terminals."
        for item, connected_targets in candidates
        if disconnects(item)
        and (end := target(item))
        and end not in connected_targets
        and end.partition(".")[0] in owners(root, base)
    ]


def owners(*files: Node) -> set[str]:
    """Return the names of the members of files, in any variant."""
    variants = [root for file in files for root in file.get("variants").entries.values()]
    return {name for root in (*files, *variants) for name in members(root)}


def connection_nodes(root: Node) -> list[Node]:
    """Return the connections that a scenario or variant itself contains."""
    return root.get("connections").items


def disconnects(connection: Node) -> bool:
    """Whether a connection is `{from: null, to: x}`."""
    return "from" in connection.entries and connection.entries["from"].value is None


def merged(base: Node, patch: Node, path: Keys = (), keep_null: bool = False) -> Node:
    """Merge `patch` over `base`. `keep_null`: both are patches, so a `null` is kept to be applied later."""
    if not isinstance(patch.value, dict):
        return merged_list(base, patch, path, keep_null) if isinstance(patch.value, list) else patch
    if path == ("algorithm",):
        algorithm = Node({"name": base}, base.location) if isinstance(base.value, str) else base
        base = Node({}, patch.location) if "name" in patch.entries else algorithm
    if len(path) == 2 and path[0] == "members" and replaces(base, patch):
        base = Node(base.only(TIMING_KEYS).value, patch.location)
    if len(path) == 3 and path[::2] == ("members", "parameters"):
        base = without_elements(base, patch)
    if not path and not keep_null:
        base = remove_members(base, [name for name, node in members(patch).items() if node.value is None])
    entries = dict(base.entries)
    for key, node in patch.entries.items():
        if node.value is None and not keep_null:
            entries.pop(key, None)
            continue
        inner_path = () if path == ("variants",) else (*path, key)
        entries[key] = merged(base.get(key), node, inner_path, keep_null or path == ("variants",))
    return Node(entries, base.location if base.entries else patch.location)


def without_elements(base: Node, patch: Node) -> Node:
    """Remove the elements of arrays, such as `play[3]`, that a patch sets as a whole: `play`."""
    arrays = {name for name, node in patch.entries.items() if node.value is not None and "[" not in name}
    return base.without(*(key for key in base.entries if "[" in key and key.partition("[")[0] in arrays))


def merged_list(base: Node, patch: Node, path: Keys, keep_null: bool) -> Node:
    """Merge lists: events are appended, connections replace those into the same target, other lists are replaced."""
    if path == ("events",):
        return Node(base.items + patch.items, patch.location)
    if path != ("connections",):
        return patch
    targets = {target(item) for item in patch.items} - {None}
    unchanged = [item for item in base.items if target(item) not in targets]
    added = [item for item in patch.items if keep_null or not disconnects(item)]
    return Node(unchanged + added, patch.location)


def target(connection: Node) -> str | None:
    """Return the target of a normalized connection, None if it is malformed."""
    name = connection.get("to").value
    return name if isinstance(name, str) else None


def replaces(base: Node, patch: Node) -> bool:
    """Whether a member's patch changes its component, so that the old parameters do not apply."""
    new, old = patch.entries.get("component"), base.entries.get("component")
    return new is not None and old is not None and new.value != old.value


def variant_trees(root: Node) -> dict[str, Node]:
    """Return each variant's full tree in the order of the file; only `base` if there are no variants."""
    base = root.without("variants")
    patches = root.get("variants").entries or {"base": Node({}, root.location)}
    return {name: apply_parameter_sets(merged(base, patch | {})) for name, patch in patches.items()}


def apply_parameter_sets(root: Node) -> Node:
    """Apply the parameter sets: members' own values override them, later sets override earlier ones."""
    patched = root.get("members")
    for parameter_set_node in reversed(root.get("parameter_sets").items):
        for name, member in patched.entries.items():
            component = member.get("component").value
            values = parameter_set_node.get(component if isinstance(component, str) else "")
            if values.entries:
                own_values = member.get("parameters") | {}
                patched |= {name: member | {"parameters": merged(values, own_values, ("members", name, "parameters"))}}
    return root | {"members": patched} if patched.entries else root
