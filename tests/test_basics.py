"""The small modules that everything shares: times, names, graphs, files, the state of a checkout, as tables."""

import errno
import logging
import re
import subprocess
from fractions import Fraction

import pytest

from tests.every_case import every_case
from twin import clock, errors, files, installed, revision
from twin.errors import CouplingError, TwinError, described, find_similar, join_names, nearest, printable
from twin.former import former_argument
from twin.graph import closure, ordered_groups, reached

MS = 1_000_000


@every_case(
    ("time", "text"),
    [
        (0, "0 s"),
        (1, "1 ns"),
        (-999, "-999 ns"),
        (1000, "1 us"),
        (999_999, "999.999 us"),
        (MS, "1 ms"),
        (-MS, "-1 ms"),
        (1000 * MS, "1 s"),
        (999 * MS, "999 ms"),
        (Fraction(10**9, 10**6 + 1), "9.99999e-07 s"),
        (Fraction(10**9, 10**6), "1e-06 s"),
        (Fraction(10**9, 3), "1/3 s"),
    ],
)
def test_times_in_words(time, text):
    if text == "1e-06 s":  # that denominator can still be read
        text = "1/1000000 s"
    assert clock.text(time) == text


@every_case(
    ("time", "part", "text"),
    [
        (10 * MS, 3 * MS, "5 ms or 2.5 ms"),
        (10 * MS, 11 * MS, "10 ms"),
        (10 * MS, 10 * MS // 3, "5 ms or 2.5 ms"),
        (MS, MS // 30, "50 us"),
        (10 * MS, 7 * MS, "10 ms or 5 ms"),
    ],
)
def test_divisors_near_a_part(time, part, text):
    assert clock.parts_near(time, part) == text


def test_ticks_of_a_loop():
    assert clock.to_ticks(5 * MS, MS) == (5 * MS, MS, clock.NANOSECONDS)
    third = Fraction(10**9, 3)
    assert clock.to_ticks(third, Fraction(10**9, 2)) == (2, 3, 6)
    assert [clock.at(count, 6) for count in (0, 2, 3)] == [0, third, 500 * MS]
    assert clock.at(7, clock.NANOSECONDS) == 7
    most = clock.MOST * Fraction(10**9, 3)  # ticks of a third of a second
    with pytest.raises(CouplingError):
        clock.to_ticks(0, third, most)
    assert clock.to_ticks(0, third, most - third) == (0, 1, 3)
    assert [clock.from_json(clock.to_json(time)) for time in (5, third)] == [5, third]
    assert clock.to_json(third) == "1000000000/3"
    assert (clock.seconds(1500 * MS), clock.seconds(third)) == (1.5, 1 / 3)
    assert clock.to_time(Fraction(4, 2)) == 2
    assert clock.whole_nanoseconds("0.001", "step") == MS
    with pytest.raises(CouplingError, match=re.escape("step: 1/3 s is not a whole number of nanoseconds.")):
        clock.whole_nanoseconds("1/3", "step")
    assert clock.common_step([6 * MS]) == 6 * MS
    assert clock.common_step([6 * MS, 4 * MS, 5 * MS]) == MS


@every_case(
    ("name", "known", "expected"),
    [
        ("abc", ["abd", "abe", "xyz"], "Did you mean 'abd' or 'abe'? Known: abd, abe, xyz."),
        ("abcde", ["abcdx", "abcdy", "abcdz", "abcdw"], "Did you mean 'abcdw', 'abcdx' or 'abcdy'?"),
        ("force_x", ["force_y", "a_force"], "Did you mean 'force_y' or 'a_force'?"),
        ("ab_q", ["ab_zzzzzzz"], "Known: ab_zzzzzzz."),  # two letters in common are few
        ("a", ["b", "b"], "Known: b."),
    ],
)
def test_suggestions(name, known, expected):
    assert nearest(name, known) == expected
    assert nearest(name, known, "`") == expected.replace("'", "`")


def test_similar_names():
    """The best first; those much less like it than the best are left out; of many, the neighbors are compared."""
    assert [match for match, _ in find_similar("position", ["position", "positions", "condition"])] == [
        "position",
        "positions",
    ]
    many = [f"n{i:05}" for i in range(errors.MANY + 1)]
    assert ("n00500", 1.0) in find_similar("n00500", many)
    assert all(abs(int(match[1:]) - 500) <= errors.MANY // 10 for match, _ in find_similar("n00500", many))
    assert ("n00000", 1.0) in find_similar("n00000", many)


def test_lists_of_names_are_cut():
    exact = ["x" * 58] * 4  # with comma and blank 60 letters each
    assert join_names(exact) == ", ".join(exact)
    assert join_names([*exact, "y"]) == ", ".join(exact) + " and 1 more"
    assert join_names(["x" * 300, "y"]) == "x" * 300 + " and 1 more"
    assert join_names(["x" * 300]) == "x" * 300
    assert join_names([]) == ""
    assert join_names(["PI+FF", "PI+FF, replayed"]) == '"PI+FF", "PI+FF, replayed"'
    assert printable("a\x1bb\u202ec\u00e9\u200b") == "a\\x1bb\\u202ecé\u200b"


def test_an_error_names_the_last_line_of_a_user():
    try:
        int("x")
    except ValueError as error:
        text = described(error)
    assert re.fullmatch(r".*test_basics\.py:\d+: ValueError: invalid literal for int\(\) with base 10: 'x'", text)
    assert described(ValueError("two\n  lines")) == "ValueError: two lines"
    assert described(SyntaxError("odd", ("a.py", 3, 1, ""))) == "a.py:3: SyntaxError: odd"
    assert (TwinError("a\nb").problems, str(TwinError(["a", "b"]))) == (["a", "b"], "a\nb")
    assert str(errors.UnknownNameError("a 'b'")) == "a 'b'"


def test_groups_of_a_graph_in_order():
    """Those that reach each other are one; each comes before its followers; otherwise as they were given."""
    assert ordered_groups("abcd", {}) == [["a"], ["b"], ["c"], ["d"]]
    assert ordered_groups("abcd", {"d": "a"}) == [["b"], ["c"], ["d"], ["a"]]
    assert ordered_groups("abc", {"a": "b", "b": "a", "c": "c"}) == [["a", "b"], ["c"]]
    assert ordered_groups("abcdef", {"a": "b", "b": "ce", "c": "d", "d": "b", "e": "f"}) == [
        ["a"],
        ["b", "c", "d"],
        ["e"],
        ["f"],
    ]
    assert ordered_groups("abc", {"c": "b", "b": "a"}) == [["c"], ["b"], ["a"]]
    ring = {"a": "b", "b": "c", "c": "ad", "d": "e", "e": "d"}
    assert ordered_groups("edcba", ring) == [["c", "b", "a"], ["e", "d"]]
    graph = {"a": "b", "b": "cd", "c": "a", "e": "a"}
    assert {node: "".join(sorted(reached(graph, node))) for node in "abde"} == {
        "a": "abcd",
        "b": "abcd",
        "d": "",
        "e": "abcd",
    }
    assert reached(graph, "") == set()
    for any_graph in (graph, ring, {"b": "b", "a": "x"}):
        assert list(closure(any_graph)) == list(any_graph)
        assert closure(any_graph) == {node: reached(any_graph, node) for node in any_graph}


def test_csv_files(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b'\xef\xbb\xbfa;b,c\n\n1;"2;3"\n ; \n4;5\n')
    assert files.read_csv(path, ";,") == [(1, ["a", "b,c"]), (3, ["1", "2;3"]), (5, ["4", "5"])]
    assert files.read_csv(path)[0] == (1, ["a;b", "c"])
    assert files.read_csv(path, "\t,")[0] == (1, ["a;b", "c"])
    for content, message in ((b"\xff", "is not UTF-8 text. Save it as CSV in UTF-8."), (b'a\n"b', "cannot be read (")):
        path.write_bytes(content)
        with pytest.raises(CouplingError) as caught:
            files.read_csv(path, error_type=CouplingError)
        assert str(caught.value).startswith(f"{path}: {message}")
    with pytest.raises(TwinError, match=r"none\.csv: cannot be read \(No such file or directory\)"):
        files.read_csv(tmp_path / "none.csv")
    for name, parts in (
        ("tip [mm]", ("tip", "mm")),
        ("x[2]", ("x[2]", "")),
        ("x[2] [ N ]", ("x[2]", "N")),
        ("a b []", ("a b", "")),
        ("[mm]", ("[mm]", "")),
    ):
        assert files.split_unit(name) == parts


def test_a_file_is_written_as_a_whole(tmp_path):
    target = tmp_path / "new/a.txt"
    files.write_atomically(target, "ü")
    files.write_atomically(target, b"\xff")
    assert (target.read_bytes(), [path.name for path in target.parent.iterdir()]) == (b"\xff", ["a.txt"])
    folder = tmp_path / "folder"
    (folder / "inner").mkdir(parents=True)
    with pytest.raises(OSError, match=re.escape(str(folder))) as caught:
        files.write_atomically(folder, b"x")
    assert (caught.value.errno, caught.value.filename) == (errno.EISDIR, str(folder))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "new"]
    with pytest.raises(UnicodeEncodeError):
        files.write_atomically(target, "\udc80")


def test_what_is_installed():
    assert [installed.is_standard_library(name) for name in ("json", "json.decoder", "numpy", "no_such_module")] == [
        True,
        True,
        False,
        False,
    ]
    assert installed.import_optional("json", "x", "y").__name__ == "json"
    with pytest.raises(TwinError) as caught:
        installed.import_optional("no_such_module.part", "python", "A plot")
    assert str(caught.value) == (
        "A plot needs no_such_module, which is not installed. Run: pip install 'catheter-twin[python]'."
    )


def test_former_arguments(caplog):
    with caplog.at_level(logging.WARNING, "twin"):
        assert former_argument("old", None, "new", 3) == 3
        assert caplog.messages == []
        assert former_argument("old", 0, "new", 3) == 0
    assert caplog.messages == ["note: old= is now new=; the old name ends with the next release."]


def test_the_revision_of_a_folder(tmp_path):
    """That of its own last commit, and whether it was changed since."""

    def git(*words):
        own = ("-c", "user.name=a", "-c", "user.email=a@b")
        done = subprocess.run(["git", "-C", str(tmp_path), *own, *words], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    folder, other = tmp_path / "part", tmp_path / "other"
    for one in (folder, other):
        one.mkdir()
        (one / "a.py").write_text("1")
    assert (revision.revision(folder), revision.checkout(folder)) == (revision.UNKNOWN, "")
    git("init", "-q")
    assert revision.revision(folder) == revision.UNKNOWN
    git("add", "part")
    git("commit", "-qm", "one")
    first = git("rev-parse", "--short=12", "HEAD")
    git("add", "other")
    git("commit", "-qm", "two")
    assert revision.revision(folder) == first
    (folder / "a.py").write_text("2")
    assert revision.revision(folder) == f"{first} with changes"
    assert revision.revision(other) == git("rev-parse", "--short=12", "HEAD")
    revision.checkout.cache_clear()
    assert revision.checkout(folder) == git("rev-parse", "--short=12", "HEAD") + "+"
    revision.checkout.cache_clear()
