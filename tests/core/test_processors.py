"""How many threads compiled code uses, and how work is divided among them."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uqpen.core import processors as module
from uqpen.core.errors import SettingsError
from uqpen.core.processors import MOST_THREADS, map_parts, processors, thread_count, use_one_thread


@pytest.fixture(autouse=True)
def machine(monkeypatch, tmp_path):
    """A machine of eight processors; return the file of its quota, which is not there."""
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr(module, "_QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(module, "_is_one_of_many", False)
    monkeypatch.delenv(MOST_THREADS, raising=False)
    return tmp_path / "cpu.max"


@pytest.mark.parametrize(
    ("quota", "expected"),
    [("max 100000", 8), ("200000 100000", 2), ("150000 100000", 2), ("50000 100000", 1)],
)
def test_a_container_may_use_what_its_quota_gives(machine, quota, expected):
    machine.write_text(f"{quota}\n")
    assert processors() == thread_count() == expected


def test_the_environment_limits_threads_and_adds_none(monkeypatch):
    for given_text, expected in (("3", 3), ("1", 1), ("99", 8), ("", 8)):
        monkeypatch.setenv(MOST_THREADS, given_text)
        assert thread_count() == expected


@pytest.mark.parametrize("mistake", ["0", "-2", "two", "1.5"])
def test_a_mistake_in_the_environment_is_reported(mistake, monkeypatch):
    monkeypatch.setenv(MOST_THREADS, mistake)
    with pytest.raises(SettingsError, match=f"UQPEN_THREADS.*{mistake}.*1 or more"):
        thread_count()


def test_a_worker_uses_one_thread():
    use_one_thread()
    assert thread_count() == 1


@given(size=st.integers(0, 100), worth=st.integers(1, 30))
def test_parts_cover_the_range_in_order_and_are_worth_a_thread(size, worth):
    parts = map_parts(lambda part: range(size)[part], size, worth)
    assert [number for part in parts for number in part] == list(range(size))
    assert len(parts) == 1 or min(map(len, parts)) >= worth


def test_parts_run_at_the_same_time():
    meeting = threading.Barrier(8, timeout=60)
    assert len(map_parts(lambda _: meeting.wait(), 8, 1)) == 8


def test_an_error_in_any_part_is_raised():
    def fail_in_the_last(part):
        if part.stop == 80:
            raise ValueError("the last")

    with pytest.raises(ValueError, match="the last"):
        map_parts(fail_in_the_last, 80, 1)
