"""One operates, the others watch."""

from twin.web.operator_lock import Seats


def test_the_first_operates_until_it_hands_over_or_leaves():
    seats, told = Seats(), []
    seats.changed.append(lambda: told.append(seats.operator))
    seats.enter("a")
    seats.enter("b")
    assert (seats.may("a"), seats.may("b")) == (True, False)
    assert not seats.give("b", "b")
    assert not seats.take("b")
    assert not seats.give("a", "stranger")
    assert seats.give("a", "b")
    assert (seats.may("a"), seats.may("b")) == (False, True)
    seats.leave("b")
    assert not seats.may("b")
    assert not seats.take("stranger")
    assert seats.take("a")
    assert told == ["a", "a", "b", None, "a"]


def test_a_page_that_comes_where_nobody_operates_does():
    seats = Seats()
    seats.enter("a")
    seats.leave("a")
    seats.enter("b")
    assert seats.may("b")
    assert seats.present == {"b": "page 2"}
