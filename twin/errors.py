"""The exception tree: everything this project raises on purpose.

TwinError                a one-line message: where, what, what was expected, what to do
├── DeclarationError     a component's variables or functions are not well formed
├── BuildError           a component cannot be compiled or linked
├── FMUError             an FMU archive, description or binary cannot be used
├── CouplingError        a system's members or connections do not fit together
│   └── ScenarioError    a scenario file is wrong
└── SimulationError      a member failed while running; what was recorded is kept
"""


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
