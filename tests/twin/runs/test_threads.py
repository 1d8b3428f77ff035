"""Work in threads: the order of the results, how far it runs ahead, errors."""

from __future__ import annotations

import sys
import threading
import time

import pytest

from twin.runs.threads import each, import_ahead, threads


@pytest.mark.parametrize("count", ["1", "3"])
def test_results_come_in_the_order_of_the_items(count: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", count)
    assert threads() == int(count)

    def slow_first(k: int) -> int:
        time.sleep(0.002 * (5 - k % 5))
        return k * k

    assert list(each(slow_first, range(20))) == [k * k for k in range(20)]
    assert list(each(slow_first, [])) == []


def test_threads_work_at_a_time_and_wait_for_who_takes_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    meet = threading.Barrier(2, timeout=5.0)
    begun: list[int] = []

    def work(k: int) -> int:
        if k < 2:
            meet.wait()  # passes only when both are under way
        begun.append(k)
        return k

    results = each(work, range(100))
    assert next(results) == 0
    time.sleep(0.02)
    assert len(begun) < 10
    assert list(results) == list(range(1, 100))


@pytest.mark.parametrize("count", ["1", "2"])
def test_an_error_arrives_and_ends_the_work(count: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", count)
    begun: list[int] = []

    def fails(k: int) -> int:
        begun.append(k)
        if k == 3:
            raise ValueError("the third")
        return k

    with pytest.raises(ValueError, match="the third"):
        list(each(fails, range(1000)))
    assert len(begun) < 20


def test_without_a_wish_all_cores_of_the_process_work(monkeypatch: pytest.MonkeyPatch) -> None:
    for said in ("", "0", "many"):
        monkeypatch.setenv("OMP_NUM_THREADS", said)
        assert threads() >= 1
    monkeypatch.setenv("OMP_NUM_THREADS", "4,2")  # OpenMP's own way of saying it for nested levels
    assert threads() == 4


@pytest.mark.parametrize(("count", "there"), [("2", True), ("1", False)])
def test_modules_are_imported_ahead_where_a_core_is_free(
    count: str, there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", count)
    monkeypatch.delitem(sys.modules, "this_is_no_module", raising=False)
    monkeypatch.delitem(sys.modules, "nturl2path", raising=False)
    before = set(threading.enumerate())
    import_ahead("this_is_no_module", "nturl2path")
    for thread in set(threading.enumerate()) - before:
        thread.join()
    assert ("nturl2path" in sys.modules) == there
