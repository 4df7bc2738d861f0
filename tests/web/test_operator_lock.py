"""One operates, the others watch."""

from twin.web.operator_lock import OperatorLock


def test_the_first_operates_until_it_hands_over_or_leaves():
    lock, told = OperatorLock(), []
    lock.changed.append(lambda: told.append(lock.operator))
    lock.enter("a")
    lock.enter("b")
    assert (lock.is_operator("a"), lock.is_operator("b")) == (True, False)
    assert not lock.hand_over("b", "b")
    assert not lock.acquire("b")
    assert not lock.hand_over("a", "stranger")
    assert lock.hand_over("a", "b")
    assert (lock.is_operator("a"), lock.is_operator("b")) == (False, True)
    lock.leave("b")
    assert not lock.is_operator("b")
    assert not lock.acquire("stranger")
    assert lock.acquire("a")
    assert told == ["a", "a", "b", None, "a"]


def test_a_page_that_comes_where_nobody_operates_does():
    lock = OperatorLock()
    lock.enter("a")
    lock.leave("a")
    lock.enter("b")
    assert lock.is_operator("b")
    assert lock.pages == {"b": "page 2"}
