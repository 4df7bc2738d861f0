"""One operates, the others watch."""

from twin.web.operator_lock import OperatorLock


def test_the_first_operates_until_it_hands_over_or_leaves():
    seats, told = OperatorLock(), []
    seats.changed.append(lambda: told.append(seats.operator))
    seats.enter("a")
    seats.enter("b")
    assert (seats.is_operator("a"), seats.is_operator("b")) == (True, False)
    assert not seats.give("b", "b")
    assert not seats.take("b")
    assert not seats.give("a", "stranger")
    assert seats.give("a", "b")
    assert (seats.is_operator("a"), seats.is_operator("b")) == (False, True)
    seats.leave("b")
    assert not seats.is_operator("b")
    assert not seats.take("stranger")
    assert seats.take("a")
    assert told == ["a", "a", "b", None, "a"]


def test_a_page_that_comes_where_nobody_operates_does():
    seats = OperatorLock()
    seats.enter("a")
    seats.leave("a")
    seats.enter("b")
    assert seats.is_operator("b")
    assert seats.present == {"b": "page 2"}
