"""The exception tree: everything this project raises on purpose.

TwinError                one line or several, each: where, what, what was expected, what to do
├── DeclarationError     a component's variables or functions are not well formed
├── BuildError           a component cannot be compiled or linked
├── FMUError             an FMU archive, description or binary cannot be used
├── CouplingError        a system's members or connections do not fit together
│   └── ScenarioError    a scenario file is wrong
├── SceneError           a drawing of an environment is wrong, or a scene cannot be drawn
├── UnknownNameError     nothing has the name that was asked for, as a key
└── SimulationError      a member failed while running; what was recorded is kept
"""

import unicodedata
from bisect import bisect
from collections.abc import Iterable
from pathlib import Path
from typing import Any

LIKE = 0.61  # ratio of equal letters from which a name may be what was meant (difflib)
TYPO = 0.8  # and from which it surely was
MANY = 1000  # of more names only the neighbors in the alphabet are compared
LISTED = 240  # letters of a list of names
BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}  # they reorder what is seen


def nearest(name: str, known: Iterable[str], quote: str = "'") -> str:
    """What may have been meant instead of an unknown name, and unless that is sure, the names that there are."""
    names = sorted(set(known))
    if not names:
        return "There are none."
    close = similar(name, names)
    meant = [f"{quote}{one}{quote}" for one, _ in close]
    question = f"Did you mean {' or '.join(filter(None, [', '.join(meant[:-1]), *meant[-1:]]))}?" if meant else ""
    if close and close[0][1] >= TYPO:
        return question
    return f"{question} Known: {listing(names)}.".lstrip()


def similar(name: str, names: list[str]) -> list[tuple[str, float]]:
    """The three names most like another one, the best first, with their ratios: like letters, or a word in common."""
    if len(names) > MANY:
        place = bisect(names, name)
        names = names[max(place - MANY // 10, 0) : place + MANY // 10]
    import difflib

    plain = name.casefold()
    matcher, own = difflib.SequenceMatcher(b=plain), set(plain.split("_"))
    found = []
    for one in names:
        matcher.set_seq1(one.casefold())
        shared = len(max(own.intersection(one.casefold().split("_")), key=len, default="")) > 2
        if shared or (matcher.real_quick_ratio() >= LIKE and matcher.quick_ratio() >= LIKE):
            ratio = matcher.ratio()
            if shared or ratio >= LIKE:
                found.append((one, ratio))
    found.sort(key=lambda pair: -pair[1])
    return [(one, ratio) for one, ratio in found[:3] if ratio >= found[0][1] - (1.0 - LIKE) / 2]


def listing(names: list[str]) -> str:
    """Names separated by commas, as many as one reads."""
    length = count = 0
    for count, one in enumerate(names):
        length += len(one) + 2
        if length > LISTED and count:
            return f"{', '.join(names[:count])} and {len(names) - count} more"
    return ", ".join(names)


def printable(text: str) -> str:
    """Text from anywhere for one line of a terminal: what would control or reorder it becomes visible, like `\\x1b`."""
    if text.isprintable():
        return text
    return "".join(one.encode("unicode_escape").decode() if controls(one) else one for one in text)


def controls(letter: str) -> bool:
    """Whether a character does something to a terminal or to the line instead of being seen."""
    return (
        unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") or unicodedata.bidirectional(letter) in BIDIRECTIONAL
    )


def described(error: BaseException) -> str:
    """Any exception in one line, with the last line of code that is not the engine's: `model.py:12: ValueError: ...`."""
    own = str(Path(__file__).parent)
    if isinstance(error, SyntaxError):
        place = f"{error.filename}:{error.lineno}: "
    else:
        import traceback

        frames = [
            frame
            for frame in traceback.extract_tb(error.__traceback__)
            if not frame.filename.startswith((own, "<")) and "importlib" not in frame.filename
        ]
        place = f"{frames[-1].filename}:{frames[-1].lineno}: " if frames else ""
    text = " ".join(str(getattr(error, "msg", error)).split())
    return f"{place}{type(error).__name__}: {text}"


class TwinError(Exception):
    """A failure told to a person. `problems`: messages of one line each."""

    def __init__(self, problems: str | list[str] = "") -> None:
        self.problems = problems.splitlines() if isinstance(problems, str) else problems
        super().__init__("\n".join(self.problems))


class DeclarationError(TwinError):
    """A component's variables or functions are not well formed."""


class BuildError(TwinError):
    """A component cannot be compiled or linked."""


class FMUError(TwinError):
    """An FMU archive, its description or its binary cannot be used."""


class CouplingError(TwinError):
    """A system's members or connections do not fit together; `problems` lists all of them."""


class ScenarioError(CouplingError):
    """A scenario file is wrong; `problems` lists every place."""


class SceneError(TwinError):
    """A drawing of an environment is wrong, or a scene cannot be drawn; `problems` lists every place."""


class UnknownNameError(TwinError, KeyError):
    """Nothing has the name that was asked for in `[...]`; the message says which names there are."""

    __str__ = Exception.__str__  # KeyError's own would put the message in quotes


class SimulationError(TwinError):
    """A member failed while running; what was recorded until then is kept, in `results` if nowhere else."""

    results: Any = None
