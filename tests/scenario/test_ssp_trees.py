"""What a flattened SSP becomes: the tree of a scenario with every value where the files have it."""

from __future__ import annotations

import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from twin import ssp
from twin.scenario import ssp_reader
from twin.scenario.yaml_files.yaml_node import SourceLocation
from twin.ssp import FlatConnection, FlatMember, FlatSystem


@pytest.mark.parametrize(
    ("where", "location"),
    [
        ("a.ssd:12", SourceLocation("a.ssd", 12)),
        ("a.ssd", SourceLocation("a.ssd")),
        ("a:b", SourceLocation("a:b")),
        (":7", SourceLocation(":7")),
    ],
)
def test_locations(where: str, location: SourceLocation) -> None:
    assert ssp_reader.parse_location(where) == location


def variant(name: str = "", **more: Any) -> Any:
    options = {"description": "", "start": None, "stop": None, "step": None, "annotations": {}, "extra": None} | more
    return SimpleNamespace(name=name, where="a.ssd:3", system=SimpleNamespace(name="rig"), **options)


def member(step: float | None = None, stop: float | None = None, **more: Any) -> FlatMember:
    return FlatMember("a", "/x/a.fmu", "a.ssd:5", SimpleNamespace(step=step, stop=stop), **more)  # type: ignore[arg-type]


def tree(one: Any, flat: FlatSystem, problems: list[str] | None = None) -> Any:
    return ssp_reader.scenario(one, flat, "a.ssp", [] if problems is None else problems)


def system(**members: FlatMember) -> FlatSystem:
    flat = FlatSystem()
    flat.members.update(members)
    return flat


@pytest.mark.parametrize(
    ("one", "members", "times"),
    [
        (variant(), {"a": member()}, {}),
        (
            variant(start=1.0, stop=5.0, step=0.01),
            {"a": member(0.1, 9.0)},
            {"start_time": 1.0, "stop_time": 5.0, "step": 0.01},
        ),
        (variant(stop=0.0), {"a": member(0.1, 9.0)}, {"stop_time": 0.0, "step": 0.1}),
        (variant(), {"a": member(0.2, 9.0), "b": member(0.1, 7.0), "c": member()}, {"stop_time": 9.0, "step": 0.1}),
    ],
)
def test_times_of_an_experiment(one: Any, members: dict[str, FlatMember], times: dict[str, float]) -> None:
    """Where nothing is said, the last stop time and the smallest step that an FMU suggests."""
    found = tree(one, system(**members)).plain()
    assert {key: found[key] for key in ("start_time", "stop_time", "step") if key in found} == times
    assert list(found["members"]) == list(members)


def test_members_and_connections_with_their_locations(tmp_path: Path) -> None:
    """Annotated keys of a member count before those of an older archive; structure comes from the SSP alone."""
    extra = tmp_path / "extra.yaml"
    extra.write_text(
        "title: own\nevents: [{at: 1 s}]\nstop_time: 9 s\n"
        "members: {a: {period: 3 ms, isolate: true, component: other, parameters: {k: 9}}}\n"
        "connections: [{from: a.y, to: b.u, bond: old}, {from: a.z, to: b.v}]\n"
    )
    flat = system(
        a=member(implementation="CoSimulation", communication_step=0.002, parameters={"k": (2.5, "p.ssv:8")}),
        b=member(implementation="any"),
    )
    flat.wires.append(FlatConnection("a.y", "b.u", None, "a.ssd:20"))
    change: Any = SimpleNamespace(factor=2.0, offset=1.0)
    flat.wires.append(FlatConnection("a.z", "b.v", change, "a.ssd:21"))
    found = tree(variant("fast", description="for people", stop=3.0, extra=extra), flat)
    assert found.plain() == {
        "title": "own",
        "description": "for people",
        "events": [{"at": "1 s"}],
        "stop_time": 3.0,
        "members": {
            "a": {
                "component": "/x/a.fmu",
                "interface": "co_simulation",
                "communication_step": 0.002,
                "parameters": {"k": 2.5},
                "period": "3 ms",
                "isolate": True,
            },
            "b": {"component": "/x/a.fmu"},
        },
        "connections": [
            {"from": "a.y", "to": "b.u", "bond": "old"},
            {"from": "a.z", "to": "b.v", "factor": 2.0, "offset": 1.0, "convert": False},
        ],
    }
    assert str(found.find(("members", "a", "parameters", "k")).location) == "p.ssv:8"
    assert str(found.find(("connections", 1)).location) == "a.ssd:21"
    assert str(found.location) == "a.ssd:3"
    assert tree(variant(), flat).plain()["title"] == "rig"
    assert tree(variant("fast"), flat).plain()["title"] == "fast"


def test_an_ssp_without_members_or_with_extra_keys_that_cannot_be_read(tmp_path: Path) -> None:
    problems: list[str] = []
    assert tree(variant(), FlatSystem(), problems).plain()["members"] == {}
    assert problems == ["a.ssd:3: the system has no FMU. Add a component."]
    file = tmp_path / "extra" / "twin" / "a.yaml"
    file.parent.mkdir(parents=True)
    file.write_text("a: ]\n")
    problems.clear()
    assert ssp_reader.extra(variant(extra=file), "a.ssp", problems).plain() == {}
    assert len(problems) == 1
    assert problems[0].startswith("a.ssp/extra/twin/a.yaml:1: not YAML")
    file.write_text("[1]")
    assert ssp_reader.extra(variant(extra=file), "a.ssp", problems).plain() == {}


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Any:
    """An archive with these variants and messages."""
    messages = SimpleNamespace(problems=[], deviations=[], notes=[])
    made = SimpleNamespace(variants=[variant("one", stop=2.0, step=0.1)], messages=messages)
    monkeypatch.setattr(ssp, "open_package", lambda *_: made)
    monkeypatch.setattr(
        ssp, "flatten", lambda one, _: FlatSystem({"a": member()}, [], [f"{one.name} wrong"], ["a note"])
    )
    return made


def test_variants_of_an_archive(package: Any) -> None:
    """Of a single one its tree; of several what they share, and the keys of each."""
    problems: list[str] = []
    found = ssp_reader.read(Path("a.ssp"), "a.ssp", problems).plain()
    assert (found["title"], found["stop_time"], "variants" in found) == ("one", 2.0, False)
    assert problems == ["one wrong"]
    package.variants.append(variant("two", stop=3.0, step=0.2, description="more"))
    problems.clear()
    found = ssp_reader.read(Path("a.ssp"), "a.ssp", problems).plain()
    own = {"members": {"a": {"component": "/x/a.fmu"}}, "connections": []}
    assert found == {
        "stop_time": 2.0,
        "step": 0.1,
        "variants": {
            "one": {"title": "one", "stop_time": 2.0, "step": 0.1, **own},
            "two": {"title": "two", "stop_time": 3.0, "step": 0.2, **own},
        },
    }
    assert problems == ["one wrong", "two wrong"]
    package.variants.append(variant("late", start=1.5))
    problems.clear()
    ssp_reader.read(Path("a.ssp"), "a.ssp", problems)
    assert problems[-1] == "a.ssp: the variants start at 0 s and 1.5 s. Give them one start time."


@pytest.mark.parametrize("strict", [False, True])
def test_deviations_from_the_standard(package: Any, caplog: pytest.LogCaptureFixture, strict: bool) -> None:
    package.messages.deviations.append("a.ssd:9: deviates")
    package.messages.problems.append("a.ssd:4: is wrong")
    token = ssp_reader.STRICT.set(strict)
    problems: list[str] = []
    with caplog.at_level(logging.WARNING):
        ssp_reader.read(Path("a.ssp"), "a.ssp", problems)
    ssp_reader.STRICT.reset(token)
    assert problems == ["a.ssd:4: is wrong", *["a.ssd:9: deviates"] * strict, "one wrong"]
    assert [record.getMessage() for record in caplog.records] == ["note: a.ssd:9: deviates"] * (not strict)


def test_notes_about_an_archive(package: Any) -> None:
    package.messages.notes.append("a remark")
    package.variants.append(variant("two"))
    assert ssp_reader.notes(Path("a.ssp"), "a.ssp") == [
        "a remark",
        "a note",
        "a.ssd:3: says no communication step: it is the smallest that an FMU suggests, or 1 ms.",
    ]


def test_paths_that_are_read_as_an_ssp(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    assert not ssp_reader.is_package(folder)
    (folder / ssp.DEFAULT).write_text("")
    assert ssp_reader.is_package(folder)
    for name, is_package in (("a.ssp", True), ("a.ssd", True), ("a.xml", True), ("a.yaml", False)):
        assert not ssp_reader.is_package(tmp_path / name)
        (tmp_path / name).write_text("")
        assert ssp_reader.is_package(tmp_path / name) is is_package
