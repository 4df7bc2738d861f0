"""Keys of an identify file as values: bounds and first guesses, probabilities, files, the name of the only member."""

from math import nan

import pytest

from tests.every_case import every_case
from tests.study.recordings import identify_file
from twin.identify.recordings.reader import KeyReader, member_of
from twin.identify.recordings.schema import FileKeys, IdentifyKeys, RangeKeys, probability
from twin.scenario import read, validate


@every_case(
    ("component", "name"),
    [
        ("sheath", "sheath"),
        ("tests.study:Heart", "Heart"),
        ("/a/b/pump.fmu", "pump"),
        ("a.yaml#group", "group"),
        ("heart@2", "heart"),
        ("a b-c", "a_b_c"),
        ("", "part"),
    ],
)
def test_name_of_the_only_member(component, name):
    assert member_of(component) == name


@pytest.mark.parametrize(
    ("keys", "now", "expected", "message"),
    [
        ({"from": "1 mm", "to": "3 mm"}, 2e-3, (1e-3, 3e-3, 2e-3), ""),
        ({"from": "1 mm", "to": "3 mm"}, 3e-3, (1e-3, 3e-3, 3e-3), ""),
        ({"from": "1 mm", "to": "3 mm"}, 4e-3, (1e-3, 3e-3, 2e-3), ""),  # the model's own value is outside: the middle
        ({"from": "1 mm", "to": "3 mm"}, nan, (1e-3, 3e-3, 2e-3), ""),
        ({"from": "1 mm", "to": "4 mm", "scale": "log"}, nan, (1e-3, 4e-3, 2e-3), ""),
        ({"from": "1 mm", "to": "4 mm", "start": "4 mm"}, 2e-3, (1e-3, 4e-3, 4e-3), ""),
        (
            {"from": "1 mm", "to": "4 mm", "start": "0.9 mm"},
            2e-3,
            None,
            "start 0.9 mm is outside of 1 mm to 4 mm. Move it.",
        ),
        ({"from": "2 mm", "to": "2 mm"}, nan, None, "from 2 mm is not below to 2 mm. Swap them."),
        (
            {"from": "0 mm", "to": "2 mm", "scale": "log"},
            nan,
            None,
            "from 0 mm is not above zero, as scale: log needs it.",
        ),
        ({"to": "2 mm"}, 1e-3, (0.0, 1.0, 0.5), "`from` is missing. Give both bounds"),
        ({"from": "2 mm"}, 1e-3, (0.0, 1.0, 0.5), "`to` is missing. Give both bounds"),
        ({"from": "1 N", "to": "2 mm"}, 1e-3, (0.0, 1.0, 0.5), "does not convert to m"),
    ],
)
def test_bounds_and_first_guess(tmp_path, keys, now, expected, message):
    path = identify_file(tmp_path)
    reader = KeyReader(path, read(path, str(path)), [])
    found = reader.range(RangeKeys.model_validate(keys), "m", now, "fit")
    assert [message in one for one in reader.problems] == ([True] if message else [])
    if expected:
        assert found == pytest.approx(expected)


@pytest.mark.parametrize(("value", "fraction"), [("95 %", 0.95), ("50 %", 0.5), (0.99, 0.99), (" 90% ".rstrip(), 0.9)])
def test_a_probability(value, fraction):
    assert probability(value) == pytest.approx(fraction)


@every_case("value", ["100 %", "49.9 %", 1, 0.4, "most", None, [0.9]])
def test_no_probability(value):
    with pytest.raises(ValueError, match="expected a probability from 50 % to below 100 %"):
        probability(value)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("a.csv", [FileKeys(file="a.csv")]),
        ({"file": "a.csv", "seed": 1}, [FileKeys(file="a.csv", seed=1)]),
        (["a", {"file": "b"}], [FileKeys(file="a"), FileKeys(file="b")]),
    ],
)
def test_files_by_their_paths(value, expected):
    assert IdentifyKeys.model_validate({"data": value}).data == expected


@pytest.mark.parametrize("data", ["{a.csv: {gap: 2 s}}", "5", "[{file: a.csv, gaps: 2 s}]"])
def test_a_wrong_single_entry_leaves_the_other_keys(data, tmp_path):
    """A file stands for a list of one; its mistakes are not that all other keys are missing."""
    path = tmp_path / "a.yaml"
    path.write_text(f"title: kept\ndata: {data}\n")
    problems = []
    keys, _, found = validate(read(path, "a.yaml", problems), IdentifyKeys)
    assert keys.title == "kept"
    assert problems == []
    assert [line.startswith("a.yaml:2: data[1]") for line in found] == [True]
