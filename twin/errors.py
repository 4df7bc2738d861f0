"""The exception tree: everything this project raises on purpose.

TwinError                a one-line message: where, what, what was expected, what to do
├── DeclarationError     a component's variables or functions are not well formed
├── BuildError           a component cannot be compiled or linked
├── FMUError             an FMU archive, description or binary cannot be used
├── CouplingError        a system's members or connections do not fit together
│   └── ScenarioError    a scenario file is wrong
└── SimulationError      a member failed while running; what was recorded is kept
"""

import traceback
from pathlib import Path


def described(error: BaseException) -> str:
    """Any exception in one line, with the last line of code that is not the engine's: `model.py:12: ValueError: ...`."""
    own = str(Path(__file__).parent)
    if isinstance(error, SyntaxError):
        place = f"{error.filename}:{error.lineno}: "
    else:
        frames = [
            frame
            for frame in traceback.extract_tb(error.__traceback__)
            if not frame.filename.startswith((own, "<")) and "importlib" not in frame.filename
        ]
        place = f"{frames[-1].filename}:{frames[-1].lineno}: " if frames else ""
    text = " ".join(str(getattr(error, "msg", error)).split())
    return f"{place}{type(error).__name__}: {text}"


class TwinError(Exception):
    """A failure with a one-line message made for the person at the terminal."""


class DeclarationError(TwinError):
    """A component's variables or functions are not well formed."""


class BuildError(TwinError):
    """A component cannot be compiled or linked."""


class FMUError(TwinError):
    """An FMU archive, its description or its binary cannot be used."""


class CouplingError(TwinError):
    """A system's members or connections do not fit together; `problems` lists all of them."""

    def __init__(self, problems: str | list[str]) -> None:
        self.problems = [problems] if isinstance(problems, str) else problems
        super().__init__("\n".join(self.problems))


class ScenarioError(CouplingError):
    """A scenario file is wrong; `problems` lists every place."""


class SimulationError(TwinError):
    """A member failed while running; what was recorded until then is kept."""
