"""Chains of tasks that are stored: each task is done once, also after an interruption."""

from __future__ import annotations

import pytest

from vibroplat.study.pool import Inline, StoredChain, Task, WorkerLostError, run_stored
from vibroplat.study.store import Store


class Interrupted(BaseException):
    pass


class Squares:
    """Squares numbers, and counts; may be interrupted after some."""

    def __init__(self, most=100):
        self.calls = []
        self.most = most

    def square(self, number):
        if len(self.calls) == self.most:
            raise Interrupted
        self.calls.append(number)
        return {"square": number**2}

    def powers(self, number, limit):
        """Square a number until a limit is passed: how often follows from the results."""
        count = 0
        while number <= limit:
            record = yield Task(self.square, (number,))
            number, count = record["square"], count + 1
        return number, count


def run(squares, store, *numbers):
    return run_stored([StoredChain(squares.powers(n, 100), store, f"from {n}") for n in numbers], Inline())


def test_tasks_follow_from_results_and_chains_take_turns():
    squares = Squares()
    with Store(None, {}) as store:
        assert run(squares, store, 2, 3, 200) == [(256, 3), (6561, 3), (200, 0)]
        assert [record for _, record in store.read("from 2")] == [{"square": n} for n in (4, 16, 256)]
        assert len(store) == 6
    assert squares.calls == [2, 3, 4, 9, 16, 81]


@pytest.mark.parametrize("most", range(7))
def test_interrupted_chains_go_on_where_they_were(most, tmp_path):
    with Store(tmp_path, {}) as store:
        if most < 6:
            with pytest.raises(Interrupted):
                run(Squares(most), store, 2, 3)
        else:
            run(Squares(most), store, 2, 3)
    squares = Squares()
    with Store(tmp_path, {}, resume=True) as store:
        assert len(store) == most
        assert run(squares, store, 2, 3) == [(256, 3), (6561, 3)]
    assert len(squares.calls) == 6 - most


def test_parts_of_a_store_have_chains_of_their_own():
    squares = Squares()
    with Store(None, {}) as store:
        assert run(squares, store, 2) == run(squares, store.part("a"), 2) == run(squares, store.part("b"), 2)
        assert len(store) == 9
        assert run(squares, store.part("a"), 2) == [(256, 3)]
    assert len(squares.calls) == 9


def test_chain_is_done_when_nothing_is_left():
    with Store(None, {}) as store:
        chain = StoredChain(Squares().powers(20, 100), store, 0)
        assert not chain.done
        chain.take({"square": 400})
        assert chain.done
        assert chain.result == (400, 1)


def test_task_whose_worker_is_lost_is_no_result():
    with Store(None, {}) as store:
        chain = StoredChain(Squares().powers(2, 100), store, 0)
        with pytest.raises(WorkerLostError, match="died"):
            chain.take(WorkerLostError("its worker died 2 times"))
        assert len(store) == 0


def test_task_may_have_a_record_for_a_lost_worker():
    def one():
        return (yield Task(dict, if_lost=lambda reason: {"why": reason}))

    with Store(None, {}) as store:
        chain = StoredChain(one(), store, 0)
        chain.take(WorkerLostError("its worker died 2 times"))
        assert chain.result == {"why": "its worker died 2 times"}
        assert len(store) == 1
