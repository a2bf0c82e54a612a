from __future__ import annotations

import pytest

from vibroplat.study.execution import Inline, WorkerLostError
from vibroplat.study.store import Store
from vibroplat.study.tasks import Task, run_tasks


def test_tasks_are_done_once():
    calls = []

    def square(number):
        calls.append(number)
        return {"square": number**2}

    with Store(None, {}) as store:
        for _ in range(2):
            tasks = [Task(store, i, square, i) for i in range(3)]
            assert run_tasks(tasks, Inline()) == [{"square": 0}, {"square": 1}, {"square": 4}]
    assert calls == [0, 1, 2]


def test_task_whose_worker_is_lost_is_no_result():
    with Store(None, {}) as store:
        task = Task(store, 0, dict)
        with pytest.raises(WorkerLostError, match="died"):
            task.take(WorkerLostError("its worker died 2 times"))
        assert len(store) == 0
