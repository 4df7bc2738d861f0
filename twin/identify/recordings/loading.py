"""From an identify file to a problem: one recording, or several with unknowns in common; every mistake is told at once."""

from __future__ import annotations

from pathlib import Path

from twin.identify.problem import Problem, Unknown
from twin.identify.recordings.recording import Loader
from twin.identify.recordings.schema import IdentifyKeys
from twin.scenario import Node, read, validate

MERGED = ("set", "fit")  # keys of which a recording's own entries are added to those of all


def load(path: str | Path) -> Problem:
    """Read and check an identify file; ScenarioError lists all problems."""
    problems: list[str] = []
    _, root, keys_problems = validate(read(Path(path), str(path), problems), IdentifyKeys)
    problems += keys_problems
    return together([Loader(Path(path), *recording, problems) for recording in recordings(root)])


def recordings(root: Node) -> list[tuple[str, Node, frozenset[str]]]:
    """Name and keys of each recording, and what is looked for in it alone; the file itself if it names none."""
    shared = {key: node for key, node in root.entries.items() if key != "recordings"}
    several = root.entries.get("recordings", Node({}, root.location)).entries
    nodes = []
    for name, node in several.items():
        entries = {**shared, **node.entries}
        for key in MERGED:
            if key in shared and key in node.entries:
                entries[key] = Node({**shared[key].entries, **node.entries[key].entries}, node.location)
        own = node.entries.get("fit", Node({}, node.location)).entries
        nodes.append((name, Node(entries, node.location), frozenset(own)))
    return nodes or [("", root, frozenset())]


def together(loaders: list[Loader]) -> Problem:
    """The problem of one recording or of several: what is looked for everywhere, and in one of them alone."""
    for loader in loaders:
        loader.open()
    if any(loader.model is None for loader in loaders):
        loaders[0].stop_if_wrong()
    for loader in loaders:
        loader.look()
    unknowns = [unknown for loader in loaders for unknown in loader.parameters(loaders)]
    for loader in loaders:
        loader.alone(unknowns)
    loaders[0].stop_if_wrong()
    for loader in loaders:
        loader.reduce()
    refuse_without_influence(unknowns, loaders)
    unknowns += [free for loader in loaders for free in loader.free]
    done = tuple(loader.recording(unknowns) for loader in loaders)
    notes = tuple(dict.fromkeys(note for loader in loaders for note in loader.notes))
    components = {name: member.component for loader in loaders for name, member in loader.full_case.members.items()}
    return Problem(loaders[0].path, loaders[0].keys, done, tuple(unknowns), notes, components)


def refuse_without_influence(unknowns: list[Unknown], loaders: list[Loader]) -> None:
    """Tell of parameters that nothing depends on that is compared, in no recording."""
    for unknown in unknowns:
        own = [loader for loader in loaders if unknown.recording in ("", loader.name)]
        if any(unknown.member in loader.reduced.members for loader in own):
            continue
        compared = dict.fromkeys(output.signal for loader in own for output in loader.keys.outputs.values())
        own[0].add_problem(
            f"{unknown.member} has no influence on {', '.join(compared)}: nothing leads from it there. Leave it out, or "
            f"compare what it moves.",
            "fit",
            unknown.path,
        )
