"""Base class of co-simulation algorithms: order of stepping, extrapolation and step control, as data for the compiled loop."""

from __future__ import annotations

from abc import ABC, ABCMeta
from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

from twin import clock
from twin.coupling import model_exchange_groups
from twin.coupling.system import stepping_order
from twin.coupling.variable_step.record_layout import DOUBLING, FIXED, PREDICTED, SCHEMES
from twin.errors import CouplingError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection

Limits = tuple[float, float, bool]  # lowest and highest value of an option, and whether it must be above the lowest
LIMITS: Mapping[str, Limits] = {
    "order": (0, 2, False),
    "smoothing": (0.0, 1.0, False),
    "tolerance": (0.0, 1.0, True),
    "smallest": (1, 1e18, False),  # [ns]
    "floor": (0.0, 1e300, True),
    "iterations": (0, 1000, False),
    "agreement": (0.0, 1.0, True),
    "correction": (0.0, 1.0, False),
}
FINEST = 1 << 16  # largest number of divisions of a step, with which times stay exact


class AlgorithmRegistry(ABCMeta):
    """Metaclass and registry: `Algorithm("jacobi")` creates an algorithm by name, iterating `Algorithm` yields all."""

    classes: ClassVar[dict[str, type[Algorithm]]] = {}

    def __call__(cls, *arguments: Any, **options: Any) -> Any:
        """Create an algorithm from its name, or from a mapping of `name` and options; CouplingError if one is unknown."""
        if cls.__name__ != "Algorithm":
            return super().__call__(**options)
        argument = arguments[0] if arguments else "jacobi"
        if isinstance(argument, Algorithm):
            return argument
        settings = {"name": argument} if isinstance(argument, str) else dict(argument)
        name = settings.pop("name", None)
        if name not in AlgorithmRegistry.classes:
            raise CouplingError(
                f"algorithm: there is no {name!r}. {nearest(str(name), list(AlgorithmRegistry.classes))}"
            )
        algorithm_class = AlgorithmRegistry.classes[name]
        option_names = [option.name for option in fields(algorithm_class) if option.init]  # type: ignore[arg-type]
        if unknown := [key for key in (*settings, *options) if key not in option_names]:
            raise CouplingError(f"algorithm: {name} has no option {unknown[0]!r}. {nearest(unknown[0], option_names)}")
        return algorithm_class(**settings, **options)

    def __len__(cls) -> int:
        return len(AlgorithmRegistry.classes)

    def __contains__(cls, item: object) -> bool:
        return isinstance(item, Algorithm)

    def __iter__(cls) -> Iterator[Algorithm]:
        """Iterate over all algorithms with default options, the plain ones first."""
        algorithms = [algorithm_class() for algorithm_class in AlgorithmRegistry.classes.values()]
        return iter(
            sorted(
                algorithms,
                key=lambda algorithm: (not algorithm.is_plain, algorithm.rolls_back, algorithm.is_sequential),
            )
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Algorithm(ABC, metaclass=AlgorithmRegistry):
    """Coupling of members within one communication step.

    `order`: of the polynomial that extrapolates an input over a step. `smoothing`: 0 to 1, the share of its jumps at the
    begin of steps that is removed.
    """

    name: ClassVar[str] = ""
    is_sequential: ClassVar[bool] = False  # members are stepped one by one, along the connections
    control: ClassVar[int] = FIXED
    limits: ClassVar[Mapping[str, Limits]] = LIMITS
    fewest: ClassVar[int] = 1  # smallest steps that a step is made of at least

    order: int = 0
    smoothing: float = 0.0

    # options of algorithms that iterate, control steps, or correct energy
    iterations: ClassVar[int] = 0
    acceleration: ClassVar[str] = SCHEMES[0]
    agreement: ClassVar[float] = 0.0
    tolerance: ClassVar[float] = 0.0
    smallest: ClassVar[int] = 0  # step [ns]; 0: all steps are of one length
    floor: ClassVar[float] = 0.0
    correction: ClassVar[float] = 0.0
    scales: ClassVar[Mapping[str, Any]] = {}  # known sizes [SI] by `member.variable`
    is_strict: ClassVar[bool] = False  # a step whose iterations do not suffice ends the run

    jacobi: ClassVar[Algorithm]
    gauss_seidel: ClassVar[Algorithm]

    if TYPE_CHECKING:

        def __init__(self, argument: object = None, /, **options: Any) -> None: ...

    def __init_subclass__(cls, **_: Any) -> None:
        if cls.name:
            AlgorithmRegistry.classes[cls.name] = cls

    def __post_init__(self) -> None:
        for option in fields(self):
            if option.name in self.limits:
                self._check(option.name, *self.limits[option.name])
        if self.acceleration not in SCHEMES:
            hint = nearest(self.acceleration, list(SCHEMES))
            raise CouplingError(f"algorithm: {self.name} has no acceleration {self.acceleration!r}. {hint}")

    def _check(self, option: str, low: float, high: float, above: bool) -> None:
        """Raise CouplingError if an option is outside of its range."""
        value = getattr(self, option)
        is_valid = isinstance(value, int | float) and not isinstance(value, bool)
        if isinstance(low, int) and is_valid:
            is_valid = value == int(value)
        if not is_valid or not (low < value if above else low <= value) or not value <= high:
            range_ = f"above {low:g} up to {high:g}" if above else f"{low:g} to {high:g}"
            raise CouplingError(f"algorithm: {option} of {self.name} is {value!r}. Give {range_}.")

    def __str__(self) -> str:
        return self.name

    def __eq__(self, other: object) -> bool:
        """Compare with an algorithm, or with a name, which means default options."""
        if isinstance(other, str):
            return other in AlgorithmRegistry.classes and self == AlgorithmRegistry.classes[other]()
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def options(self) -> dict[str, Any]:
        """Options that differ from the defaults."""
        defaults = vars(type(self)())
        return {name: value for name, value in vars(self).items() if value != defaults[name]}

    @property
    def described(self) -> str:
        """Name with the options that differ from the defaults: `iterative (order: 1)`."""
        options = ", ".join(f"{name}: {value}" for name, value in self.options.items())
        return f"{self.name} ({options})" if options else self.name

    @property
    def scheme(self) -> int:
        """Number of the acceleration."""
        return SCHEMES.index(self.acceleration)

    @property
    def is_plain(self) -> bool:
        """Whether the fixed-step loop runs it."""
        return self.order == 0 and not self.rolls_back and self.control == FIXED and self.correction == 0

    @property
    def rolls_back(self) -> bool:
        """Whether members must support rollback."""
        return self.iterations > 0 or self.control in (DOUBLING, PREDICTED)

    def order_of(self, members: Mapping[str, Member], links: list[ResolvedConnection]) -> list[list[str]]:
        """Return the stages: all members at once, or one by one along their dependencies."""
        if not self.is_sequential:
            return [list(members)]
        catalog = {name: member.variables for name, member in members.items()}
        joined = model_exchange_groups.together(members, links)
        order = stepping_order(list(members), links, catalog, joined)
        return [[member for member in members if joined.get(member, member) == name] for name in order]

    def divisions(self, step: clock.Time) -> int:
        """Return the number of smallest steps in a step [ns]: a power of two."""
        return halvings(step, self.smallest, self.fewest) if self.smallest else 1 if step else 0

    @staticmethod
    def every() -> list[Algorithm]:
        """Return all algorithms with default options."""
        return list(Algorithm)

    def corrected(self, links: list[ResolvedConnection]) -> list[ResolvedConnection]:
        """Return the connections with energy correction; CouplingError if a declared bond is invalid."""
        return links[:0]

    def remarks(self, corrected: list[ResolvedConnection]) -> list[str]:
        """Return notes for the user."""
        del corrected
        return []


def halvings(step: clock.Time, smallest: clock.Time, fewest: int = 1) -> int:
    """Return the power of two that divides a step [ns] into the shortest parts of at least `smallest` [ns].

    CouplingError if fewer than `fewest` parts of that length fit.
    """
    count = 1
    while step >= 2 * count * smallest and count < FINEST:
        count *= 2
    if step < fewest * smallest:
        most = clock.text(clock.to_time(Fraction(step) / fewest))
        halves = ", of which halves are made, too" if fewest > 1 else ""
        raise CouplingError(
            f"algorithm: the smallest step {clock.text(smallest)} is too long for the step {clock.text(step)}{halves}. "
            f"Give at most {most}."
        )
    return count
