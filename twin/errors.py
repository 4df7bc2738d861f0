"""Exception hierarchy of the project, and the texts of unknown names.

TwinError                one line or several, each: where, what, what was expected, what to do
├── DeclarationError     a component's variables or functions are not well formed
├── BuildError           a component cannot be compiled or linked
├── FMUError             an FMU archive, description or binary cannot be used
├── CouplingError        a system's members or connections do not fit together
│   └── ScenarioError    a scenario file is wrong
├── SceneError           a drawing of an environment is wrong, or a scene cannot be drawn
├── UnknownNameError     a key names nothing that exists
└── SimulationError      a member failed while running; its recording is kept
"""

import re
import unicodedata
from bisect import bisect
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

LIKE = 0.61  # similarity (difflib ratio) from which a name is suggested
TYPO = 0.8  # similarity from which the suggestion suffices, without the list of names
MANY = 1000  # number of names above which only the neighbors in the alphabet are compared
LISTED = 240  # characters of a list of names
BIDIRECTIONAL = {
    "LRE",
    "RLE",
    "LRO",
    "RLO",
    "PDF",
    "LRI",
    "RLI",
    "FSI",
    "PDI",
}  # control characters that reorder a line


def nearest(name: str, candidates: Iterable[str], quote: str = "'") -> str:
    """Suggest names similar to an unknown one; without a sure match also list the available names."""
    names = sorted(set(candidates))
    if not names:
        return "There are none."
    close = find_similar(name, names)
    question = suggestion(name, names, quote)
    if close and close[0][1] >= TYPO:
        return question
    return f"{question} Known: {join_names(names)}.".lstrip()


def suggestion(name: str, candidates: Iterable[str], quote: str = "'") -> str:
    """Return `Did you mean 'a' or 'b'?` with the names similar to an unknown one; empty if there are none."""
    quoted = [f"{quote}{match}{quote}" for match, _ in find_similar(name, sorted(set(candidates)))]
    return f"Did you mean {' or '.join(filter(None, [', '.join(quoted[:-1]), *quoted[-1:]]))}?" if quoted else ""


def find_similar(name: str, names: list[str]) -> list[tuple[str, float]]:
    """Return up to three names similar to `name` with their similarity ratios, the best first.

    Similar: a difflib ratio of at least `LIKE`, or a word of more than two letters in common.
    """
    if len(names) > MANY:
        position = bisect(names, name)
        names = names[max(position - MANY // 10, 0) : position + MANY // 10]
    import difflib

    folded = name.casefold()
    matcher, words = difflib.SequenceMatcher(b=folded), set(folded.split("_"))
    matches = []
    for candidate in names:
        matcher.set_seq1(candidate.casefold())
        shared = len(max(words.intersection(candidate.casefold().split("_")), key=len, default="")) > 2
        if shared or (matcher.real_quick_ratio() >= LIKE and matcher.quick_ratio() >= LIKE):
            ratio = matcher.ratio()
            if shared or ratio >= LIKE:
                matches.append((candidate, ratio))
    matches.sort(key=lambda pair: -pair[1])
    return [(candidate, ratio) for candidate, ratio in matches[:3] if ratio >= matches[0][1] - (1.0 - LIKE) / 2]


def join_names(names: list[str]) -> str:
    """Join names with commas, quoted where one contains a separator, at most `LISTED` characters; the rest is counted."""
    names = quote_names(names)
    length = count = 0
    for count, name in enumerate(names):
        length += len(name) + 2
        if length > LISTED and count:
            return f"{', '.join(names[:count])} and {len(names) - count} more"
    return ", ".join(names)


def quote_names(names: Sequence[str]) -> list[str]:
    """Return names of variants or requirements, in quotes if one of them contains a blank or a separator of lists."""
    return [f'"{name}"' for name in names] if any(re.search(r"[\s,;]", name) for name in names) else [*names]


def printable(text: str) -> str:
    """Escape characters that would control or reorder a terminal line, such as `\\x1b`, in text from outside."""
    if text.isprintable():
        return text
    return "".join(
        character.encode("unicode_escape").decode() if is_control(character) else character for character in text
    )


def is_control(letter: str) -> bool:
    """Whether a character controls the terminal or reorders the line instead of being printed."""
    return (
        unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") or unicodedata.bidirectional(letter) in BIDIRECTIONAL
    )


def described(error: BaseException) -> str:
    """Format an exception as one line, with the last frame of the user's code: `model.py:12: ValueError: ...`.

    That is the last frame outside the engine and installed libraries, such as the caller of a NumPy function.
    """
    own = str(Path(__file__).parent)
    if isinstance(error, SyntaxError):
        location = f"{error.filename}:{error.lineno}: "
    else:
        import sysconfig
        import traceback

        frames = [
            frame
            for frame in traceback.extract_tb(error.__traceback__)
            if not frame.filename.startswith((own, "<")) and "importlib" not in frame.filename
        ]
        libraries = tuple({sysconfig.get_path(kind) for kind in ("stdlib", "purelib", "platlib")})
        frames = [frame for frame in frames if not frame.filename.startswith(libraries)] or frames
        location = f"{frames[-1].filename}:{frames[-1].lineno}: " if frames else ""
    text = " ".join(str(getattr(error, "msg", error)).split())
    return f"{location}{type(error).__name__}: {text}"


class TwinError(Exception):
    """Base class of errors that are reported to the user. `problems`: messages of one line each.

    `run`: of a failed `twin.run`, the Run with what was recorded.
    """

    run: Any = None

    def __init__(self, problems: str | list[str] = "") -> None:
        self.problems = problems.splitlines() if isinstance(problems, str) else problems
        super().__init__("\n".join(self.problems))

    def _render_traceback_(self) -> list[str]:
        """Return what a notebook shows: the person's own lines and the problems, without the frames of packages."""
        import traceback

        package = str(Path(__file__).parent)
        frames = traceback.extract_tb(self.__traceback__)
        own = [
            frame
            for frame in frames
            if not frame.filename.startswith(package) and "site-packages" not in frame.filename
        ]
        return [*(line.rstrip() for line in traceback.format_list(own)), f"{type(self).__name__}: {self}"]


class DeclarationError(TwinError):
    """A component's variables or functions are not well formed."""


class BuildError(TwinError):
    """A component cannot be compiled or linked."""


class FMUError(TwinError):
    """An FMU archive, its description or its binary cannot be used."""


class CouplingError(TwinError):
    """A system's members or connections do not fit together; `problems` lists all of them."""


class ScenarioError(CouplingError):
    """A scenario file is wrong; `problems` lists every location."""


class SceneError(TwinError):
    """A drawing of an environment is wrong, or a scene cannot be drawn; `problems` lists every location."""


class UnknownNameError(TwinError, KeyError):
    """A name in `[...]` does not exist; the message lists the available names."""

    __str__ = Exception.__str__  # `KeyError.__str__` would put the message in quotes.


class SimulationError(TwinError):
    """A member failed while running. `results`: the recording until then, if it is not in a file."""

    results: Any = None
