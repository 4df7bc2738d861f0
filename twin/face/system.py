"""A system without a file: members and connections, checked when they are added."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.component import Component
from twin.errors import ScenarioError, nearest
from twin.face import notebook
from twin.face.conversions import BackendName, as_list, choice, nanoseconds, plain, python_option_names
from twin.face.scenario import Scenario, reference
from twin.face.simulation import Simulation
from twin.former import former_argument
from twin.run import resolve_catalogs
from twin.scenario import Backend, made_scenario

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import Catalog
    from twin.scenario import Case

NAME = "system"  # in messages
DAYS = 100 * 86_400 * 10**9  # longest simulation without a stop time [ns]


class System:
    """Members and connections, as in a scenario file, for step-by-step simulation from a program.

    Problems are reported when a member or a connection is added: ScenarioError, and the system is unchanged.
    """

    def __init__(self) -> None:
        self._members: dict[str, dict[str, Any]] = {}
        self._connections: list[dict[str, str]] = []
        self._classes: dict[str, type[Component]] = {}

    @property
    def members(self) -> dict[str, str]:
        """Name and component of each member."""
        return {name: str(member["component"]) for name, member in self._members.items()}

    @property
    def connections(self) -> list[tuple[str, str]]:
        """Source and target of each connection."""
        return [(connection["from"], connection["to"]) for connection in self._connections]

    def add(
        self,
        name: str,
        component: str | Path | type[Component],
        *,
        period: float | str | None = None,
        parameters: Mapping[str, Any] | None = None,
        interface: str = "",
        solver: str = "",
        solver_tolerance: float | None = None,
        **values: Any,
    ) -> None:
        """Add a member: a component by its name in fmus/, `module:Class`, a class, or the path of an FMU.

        `values`: parameters and start values of inputs, as text with a unit or numbers in their own unit; `parameters`: those whose names are
        not valid in Python, such as `x[1]`, or are arguments here. `period`, `interface`, `solver`, `solver_tolerance`: as of a
        member of a scenario.
        """
        if name in self._members:
            raise ScenarioError(f"{NAME}: there is already a member `{name}`. Choose another name.")
        classes = dict(self._classes)
        if isinstance(component, type):
            text = reference(component, classes)
            classes[text] = component
        else:
            text = str(component)
        member: dict[str, Any] = {"component": text}
        if given := {key: plain(value) for key, value in {**(parameters or {}), **values}.items()}:
            member["parameters"] = given
        if period is not None:
            member["period"] = plain(period)
        options = {"interface": interface, "solver": solver, "solver_tolerance": solver_tolerance}
        member |= {key: plain(value) for key, value in options.items() if value}
        members = {**self._members, name: member}
        self._checked(members, self._connections, classes)
        self._members, self._classes = members, classes

    def connect(self, source: str, *targets: str) -> None:
        """Connect an output to inputs, all as `member.variable` or an element `member.x[1]`; units are converted.

        Also connects a terminal to others, as `member.terminal` or an element of an array of terminals `member.terminal[1]`.
        """
        for end in (source, *targets):
            member = end.partition(".")[0]
            if member not in self._members:
                raise ScenarioError(
                    f"{NAME}: there is no member `{member}` for {end}. {nearest(member, self._members)}"
                )
        connections = [*self._connections, *({"from": source, "to": target} for target in targets)]
        self._checked(self._members, connections, self._classes)
        self._connections = connections

    def simulate(
        self,
        step: float | str = "1 ms",
        *,
        start: float | str = 0.0,
        stop: float | str | None = None,
        algorithm: str | Mapping[str, Any] = "jacobi",
        seed: int = 0,
        backend: BackendName = "compiled",
        record: str | Sequence[str] | None = None,
        every: float | str | None = None,
        build: str | Path = "build",
        form: BackendName | None = None,
    ) -> Simulation:
        """Initialize the members at `start` and return a simulation; use it in a `with` statement, which frees them at the end.

        `step`: communication step. `stop`: end, also passed to FMUs. `record`: patterns as in a scenario, default all outputs,
        nothing if []; `every`: recording period. `backend`: fmu, compiled or interpreted; a class without available source runs
        interpreted, as `notes` of the simulation say.
        """
        backend = former_argument("form", form, "backend", backend)
        step_ns = nanoseconds(step, "step")
        begin = nanoseconds(start, "start")
        # the duration must be whole steps
        end = nanoseconds(stop, "stop") if stop is not None else begin + DAYS // max(step_ns, 1) * step_ns
        recorded: dict[str, Any] = {"variables": as_list(record)}
        if every is not None:
            recorded["every"] = plain(every)
        more = {
            "step": clock.exact_text(step_ns),
            "start_time": clock.exact_text(begin),
            "stop_time": clock.exact_text(end),
            "algorithm": plain(algorithm) if isinstance(algorithm, str) else dict(algorithm),
            "seeds": [plain(seed)],
            "record": recorded,
        }
        with python_option_names():
            case, catalog = self._checked(self._members, self._connections, self._classes, more)
            return Simulation(
                case, catalog, Backend(choice(backend, Backend, "backend")), Path(build), stop is not None, record == []
            )

    def _checked(
        self,
        members: dict[str, Any],
        connections: list[dict[str, str]],
        classes: dict[str, type[Component]],
        more: dict[str, Any] | None = None,
    ) -> tuple[Case, Catalog]:
        """Return the system as a case, and its members' variables; ScenarioError with all problems."""
        data = {"stop_time": "1 s", "members": members, "connections": connections, **(more or {})}
        checked = Scenario(made_scenario(data, NAME), classes).checked
        case = checked.cases()[0]
        return case, resolve_catalogs(checked)[case.variant]

    def __repr__(self) -> str:
        members = ", ".join(f"{name}: {component}" for name, component in self.members.items())
        return f"<System {members or 'without members'}; {len(self._connections)} connections>"

    def _repr_html_(self) -> str:
        return notebook.page(notebook.system(self.members, self.connections) or notebook.paragraph(repr(self)))
