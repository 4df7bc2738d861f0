"""`twin.dataclass` against the standard library's: the same classes made by both behave the same."""

import copy
import dataclasses
import pickle
import re
from dataclasses import FrozenInstanceError, field
from pathlib import Path

import pytest

from twin.dataclass import dataclass

OPTIONS = [
    {"frozen": frozen, "eq": eq, "slots": slots}
    for frozen in (False, True)
    for eq in (True, False)
    for slots in (False, True)
]


def made(decorator, **options):
    """A class with every kind of field, by one of the two decorators; found by pickle under its name."""

    @decorator(**options)
    class Thing:
        """A thing."""

        x: int
        name: str = "a"
        parts: list[int] = field(default_factory=list, compare=False)
        hidden: str = field(default="h", repr=False)
        set: int = 4  # a name of the text that is made, or nearly
        kept: dict[str, int] = field(init=False, default_factory=dict)

    Thing.__qualname__ = "Thing"
    globals()["Thing"] = Thing
    return Thing


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_as_the_standard_library(options):
    told = []
    for decorator in (dataclass, dataclasses.dataclass):
        cls = made(decorator, **options)
        one, same, other = cls(1, parts=[2]), cls(1, "a", [3]), cls(x=2, hidden="")
        back = pickle.loads(pickle.dumps(one))
        entries = [
            repr(one), one == same, one == other, one != other, one == 1, dataclasses.asdict(one), dataclasses.replace(one, x=5).x,
            [(f.name, f.type, f.init, f.compare) for f in dataclasses.fields(cls)], cls.__match_args__, cls.__doc__,
            cls.__hash__ is None, hasattr(one, "__dict__"), repr(back), repr(copy.copy(one)), dataclasses.is_dataclass(cls),
        ]  # fmt: skip
        if options["frozen"] and options["eq"]:
            with pytest.raises(TypeError):
                hash(one)  # of `kept`, a dict
        for wrong in ((), (1, 2, 3, 4, 5, 6)):
            with pytest.raises(TypeError):
                cls(*wrong)
        with pytest.raises(TypeError):
            cls(1, y=2)
        if options["frozen"]:
            for change in (lambda one=one: setattr(one, "x", 2), lambda one=one: delattr(one, "x")):
                with pytest.raises(FrozenInstanceError):
                    change()
        else:
            one.x = 7
            entries.append(one.x)
        told.append(entries)
    assert told[0] == told[1]


def test_equal_instances_have_one_hash():
    @dataclass(frozen=True)
    class Pair:
        a: int
        b: str

    assert hash(Pair(1, "x")) == hash(Pair(1, "x"))
    assert len({Pair(1, "x"), Pair(1, "x"), Pair(2, "x")}) == 2


def test_what_a_class_says_itself_stays():
    @dataclass
    class Own:  # noqa: PLW1641
        x: int
        late: int = field(init=False)

        def __post_init__(self):
            self.late = self.x + 1

        def __repr__(self):
            return "own"

        def __eq__(self, other):
            return True

    @dataclass
    class More(Own):
        y: int = 3

    one = More(1)
    assert (one.x, one.late, one.y, one == 5) == (1, 2, 3, False)
    assert repr(one).endswith("More(x=1, late=2, y=3)")
    assert (repr(Own(1)), Own(1) == 5) == ("own", True)


@pytest.mark.parametrize("decorator", [dataclass, dataclasses.dataclass])
def test_arguments_by_keyword_alone(decorator):
    @decorator(frozen=True, kw_only=True)
    class Base:
        a: int
        b: int = 2

    @decorator(frozen=True)
    class More(Base):
        c: int
        d: int = field(kw_only=True)

    one = More(1, a=2, d=4)
    assert (one.a, one.b, one.c, one.d) == (2, 2, 1, 4)
    for wrong in (lambda: Base(1), lambda: More(1, 2, d=4), lambda: More(1, a=2)):
        with pytest.raises(TypeError):
            wrong()


def test_the_engine_uses_it():
    """Both kinds cannot inherit from each other where they are frozen, and the standard library's are slow to import."""
    engine = Path(__file__).parents[1] / "twin"
    pattern = re.compile(r"^(from dataclasses import .*\bdataclass\b|import dataclasses)", re.MULTILINE)
    others = [one.name for one in engine.rglob("*.py") if pattern.search(one.read_text(encoding="utf-8"))]
    assert others == ["dataclass.py"]
