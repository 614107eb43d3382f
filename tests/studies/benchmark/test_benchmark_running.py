"""Rows that survive an interruption, logs that survive one another, and processes that die."""

from __future__ import annotations

import json
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import pytest

from auvnn.errors import InputError
from auvnn.studies import benchmark as study
from auvnn.studies.benchmark import benchmark, cases, running
from auvnn.studies.benchmark.cases import Case
from auvnn.studies.benchmark.journal import Journal, code_fingerprint
from auvnn.studies.benchmark.running import run_all

OPTIONS: dict[str, Any] = {
    "effects": ["cg_offset", "tether"], "sizes": "large", "noises": "realistic", "excitations": "multisine",
    "vehicles": "rov95", "coefficients": "exact", "repeats": 3, "seed": 1, "runs": 2, "duration": 5, "rate": 20,
    "workers": 1,
}  # fmt: skip


def answered(case: Case) -> dict[str, Any]:
    """Return a row at once."""
    return {
        **case.to_row(),
        "verdict": "named",
        "missing": [case.hidden],
        "fault": None,
        "errors": {},
        "seconds": 0.1,
    }


@pytest.fixture
def todo() -> list[Case]:
    return cases(OPTIONS)


def test_rows_come_back_as_they_were_written(tmp_path, todo):
    journal = Journal(tmp_path / "work" / "rows.jsonl")
    written = {case: journal.append(answered(case)) for case in todo[:4]}
    assert journal.rows(todo) == written and all(
        row["code"] == code_fingerprint() for row in written.values()
    )
    assert journal.rows(todo[2:]) == {case: written[case] for case in todo[2:4]}, "others do not belong here"


def test_a_line_cut_short_by_a_kill_costs_that_log_alone(tmp_path, todo):
    journal = Journal(tmp_path / "rows.jsonl")
    for case in todo[:2]:
        journal.append(answered(case))
    whole = journal.path.read_bytes()
    journal.path.write_bytes(whole + b'{"vehicle": "rov95", "hid')
    assert list(journal.rows(todo)) == todo[:2]
    journal.append(answered(todo[2]))
    assert list(journal.rows(todo)) == todo[:3]
    assert [json.loads(line)["seed"] for line in journal.path.read_text().splitlines()] == [
        case.seed for case in todo[:3]
    ]


def test_a_damaged_line_in_the_middle_is_refused(tmp_path, todo):
    journal = Journal(tmp_path / "rows.jsonl")
    journal.path.write_text('{"vehicle": \n{"b": 1}\n')
    with pytest.raises(InputError, match="line 1 is no row"):
        journal.rows(todo)


def test_rows_of_other_code_are_made_again_unless_they_are_asked_for(tmp_path, todo):
    Journal(tmp_path / "rows.jsonl", code="old").append(answered(todo[0]))
    new = Journal(tmp_path / "rows.jsonl", code="new")
    assert new.rows(todo) == {} and list(new.rows(todo, any_code=True)) == todo[:1]
    new.append(answered(todo[0]))
    assert new.rows(todo)[todo[0]]["code"] == "new"


def test_an_interrupted_benchmark_goes_on_where_it_was(tmp_path, todo, monkeypatch):
    made: list[Case] = []

    def until_interrupted(case: Case) -> dict[str, Any]:
        if len(made) == 4:
            raise KeyboardInterrupt
        made.append(case)
        return answered(case)

    monkeypatch.setattr(study, "run_case", until_interrupted)
    path = tmp_path / "rows.jsonl"
    with pytest.raises(KeyboardInterrupt):
        benchmark(OPTIONS, journal=path)
    assert made == todo[:4]
    made.clear()
    told: list[str] = []
    answer = benchmark(OPTIONS, told.append, journal=path)
    assert made == todo[4:] and told[0] == "going on: 4 of 6 logs are done"
    # As if it had never been interrupted.
    monkeypatch.setattr(study, "run_case", answered)
    assert answer.to_dict() == benchmark(OPTIONS, journal=tmp_path / "other.jsonl").to_dict()
    assert benchmark(OPTIONS).table == answer.table, "and without a journal"


class Pool:
    """A pool in this process whose workers die of some cases."""

    def __init__(self, deadly: set[Case], log: list[list[Case]]) -> None:
        self.deadly, self.log, self.broken = deadly, log, False
        log.append([])

    def submit(self, run: Any, case: Case) -> Future:
        self.log[-1].append(case)
        future: Future = Future()
        self.broken = self.broken or case in self.deadly
        if self.broken:
            future.set_exception(BrokenProcessPool("a process in the process pool was terminated abruptly"))
        else:
            future.set_result(run(case))
        return future

    def shutdown(self, **_: Any) -> None: ...


def test_a_log_that_kills_its_process_is_a_fault_and_the_others_are_done(todo, monkeypatch):
    log: list[list[Case]] = []
    monkeypatch.setattr(running, "ProcessPoolExecutor", lambda size, mp_context: Pool({todo[1]}, log))
    rows = {Case.of_row(row): row for row in run_all(todo, 2, answered)}
    assert set(rows) == set(todo)
    assert [c for c in todo if rows[c]["verdict"] == "fault"] == [todo[1]]
    assert "process died" in rows[todo[1]]["fault"]
    # The first two die of it together with whoever was beside them; then it runs alone.
    assert log[-1] == [todo[1]] and sum(todo[1] in batch for batch in log) == running.DEATHS + 1
    assert all(sum(c in batch for batch in log) <= running.DEATHS + 1 for c in todo)


def test_an_error_of_the_program_in_the_pool_is_not_swallowed(todo, monkeypatch):
    monkeypatch.setattr(running, "ProcessPoolExecutor", lambda size, mp_context: Pool(set(), []))

    def broken(case: Case) -> dict[str, Any]:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        list(run_all(todo, 2, broken))


def test_real_processes_do_the_work(todo):
    rows = list(run_all(todo, 2, answered))
    assert len(rows) == 6 and {Case.of_row(r) for r in rows} == set(todo)


def test_rows_of_other_runs_count_as_done_and_what_is_done_can_be_counted(tmp_path, todo, monkeypatch):
    """As if half of the logs had been made on another machine, and one on this."""
    monkeypatch.setattr(study, "run_case", lambda case: pytest.fail("a log is made again"))
    journal, other = tmp_path / "rows.jsonl", tmp_path / "other.jsonl"
    Journal(journal).append(answered(todo[0]))
    for case in todo[:3]:
        Journal(other).append({**answered(case), "seconds": 7.0})
    found = benchmark(OPTIONS, journal=journal, further=[other], only_done=True)
    assert [Case.of_row(r) for r in found.rows] == todo[:3]
    assert found.rows[0]["seconds"] == 0.1, "what is done here stays"
    assert "3 of 6 logs are done" in found.warnings[0]
    # They are this run's own from now on.
    assert list(Journal(journal).rows(todo)) == todo[:3]
    assert benchmark(OPTIONS, journal=journal, only_done=True).rows == found.rows


def test_there_must_be_something_to_count(tmp_path, todo):
    with pytest.raises(InputError, match="no log of this benchmark is done"):
        benchmark(OPTIONS, journal=tmp_path / "rows.jsonl", only_done=True)
    with pytest.raises(InputError, match="no such file"):
        benchmark(OPTIONS, further=[tmp_path / "none.jsonl"])
