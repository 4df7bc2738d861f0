"""Names and docstrings of `twin/`, `hw_bridge/` and `fmus/` use the terms of the field: a list of vague words is refused.

`CLEAN` lists the folders that are strict; it only grows. Elsewhere the number of such words must not grow.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TWIN = ROOT / "twin"

# words of a private language in names: participles, prepositions and pronouns where the field has a noun or a verb
NAMES = frozenset({
    "told", "tell", "tells", "asked", "ask", "begun", "nobody", "whoever", "somebody", "beside", "apart", "within",
    "kept", "drawn", "found", "unheard", "heard", "spoken", "written", "held", "felt", "wish", "lesson", "taught",
    "patience", "haste", "hasty", "bury", "stray", "strays", "meanwhile", "way", "ways", "place", "places",
    "thing", "things", "whole", "seen", "owed", "spent", "known", "one", "who", "whom",
})  # fmt: skip

# words in the first sentence of a docstring: software is no person
SENTENCES = re.compile(r"\b(nobody|whoever|somebody|who|whom|told|asked|begun|beside)\b", re.IGNORECASE)

# names with such a word that are right: why
ALLOWED: dict[str, str] = {
    "placeholder": "a text that stands for another: the term",
    "whole_nanoseconds": "a whole number is an integer",
    "restrict_to_known": "the name that the list of terms gives it",
    "within": "a key of expectations in scenarios: `within: [1 mm, 2 mm]`",
    "HELD": "an input that a hold of order zero keeps constant over a step: the term",
    "HELD_PREFIX": "likewise",
    "one_at_a_time": "a design of experiments: the term",
    "HeldKey": "a key or button that is held: the term for a dead-man switch",
    "held": "likewise: what is held now",
    "_held": "likewise",
    "is_held": "likewise",
    "held_button": "likewise",
    "HeldInput": "likewise",
    "held_value": "likewise",
    "update_held_inputs": "likewise",
}

# folders without such words, with those that are still there; the list grows, the words become fewer
CLEAN: dict[str, set[str]] = {
    "cli": set(),
    "compiler": set(),
    "component": set(),
    "conformance": set(),
    "console": set(),
    "coupling": set(),
    "fmi": set(),
    "follow": set(),
    "identify": set(),
    "live": set(),
    "process": set(),
    "results": set(),
    "run": set(),
    "scenario": set(),
    "scene": set(),
    "ssp": set(),
    "structure": set(),
    "validation": set(),
    "viewer": set(),
    "web": set(),
    "fmus": {"held"},  # what grippers, a hand or a controller hold
    "hw_bridge": {"written"},  # of an object or a PDO entry: what was written before it is restored
}

# in all of `twin`; to be lowered with every folder that becomes clean
MOST_NAMES, MOST_SENTENCES = 1, 1


def files(*folders: str) -> list[Path]:
    """The Python files of folders of `twin`, or all of them; other packages by their names."""
    roots = [ROOT / folder if folder in ("hw_bridge", "fmus") else TWIN / folder for folder in folders or ("",)]
    return sorted(file for root in roots for file in root.rglob("*.py"))


def defined(tree: ast.Module) -> Iterator[str]:
    """Names that a module defines: classes, functions, parameters, variables, attributes."""
    for node in ast.walk(tree):
        match node:
            case (
                ast.FunctionDef(name=name)
                | ast.AsyncFunctionDef(name=name)
                | ast.ClassDef(name=name)
                | ast.arg(arg=name)
            ):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name


def words(name: str) -> set[str]:
    """The words of a name, whether `snake_case` or `CamelCase`."""
    return set(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_"))


def odd_names(file: Path, left: Iterable[str] = ()) -> list[str]:
    """Names of a file, its own included, that contain a refused word; `left`: words that are not refused here."""
    names = {file.stem, *defined(ast.parse(file.read_text()))} - set(ALLOWED)
    return sorted(f"{file.relative_to(ROOT)}: {name}" for name in names if words(name) & (NAMES - set(left)))


def odd_sentences(file: Path) -> list[str]:
    """First sentences of the docstrings of a file that contain a refused word."""
    nodes = [
        node
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    sentences = [re.split(r"(?<=[.:;]) |\n\n", text)[0] for node in nodes if (text := ast.get_docstring(node))]
    return [f"{file.relative_to(ROOT)}: {text}" for text in sentences if SENTENCES.search(text)]


@pytest.mark.slow
@pytest.mark.parametrize("folder", CLEAN)
def test_clean_folders_stay_clean(folder):
    odd = [line for file in files(folder) for line in odd_names(file, CLEAN[folder]) + odd_sentences(file)]
    assert not odd, f"{len(odd)} names and sentences, use the terms of the field:\n" + "\n".join(odd)


@pytest.mark.slow
def test_the_number_of_odd_names_does_not_grow():
    odd = [line for file in files() for line in odd_names(file)]
    assert len(odd) <= MOST_NAMES, f"{len(odd)} names instead of {MOST_NAMES}:\n" + "\n".join(odd)


@pytest.mark.slow
def test_the_number_of_odd_sentences_does_not_grow():
    odd = [line for file in files() for line in odd_sentences(file)]
    assert len(odd) <= MOST_SENTENCES, f"{len(odd)} sentences instead of {MOST_SENTENCES}:\n" + "\n".join(odd)
