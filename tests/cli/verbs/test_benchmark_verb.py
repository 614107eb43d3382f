"""`auvnn benchmark` composes, refuses what it does not know, and runs a benchmark of one log."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from auvnn.cli.main import VERBS
from auvnn.cli.verbs.benchmark import TAKEN, _counted
from auvnn.config import config_dir, read_yaml
from auvnn.studies.benchmark import cases
from auvnn.studies.benchmark.cases import apart

TINY = ["effects=[net_buoyancy]", "repeats=1", "sizes=medium", "duration=20", "runs=2", "workers=1"]


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def test_its_options_compose_to_cases(auvnn):
    status, out, err = auvnn("benchmark", "--cfg", "job")
    assert (status, err) == (0, "")
    options = yaml.safe_load(out)
    assert set(TAKEN) <= set(options)
    found = cases(options)
    assert {c.vehicle for c in found} == {"rov95"} and {c.noise for c in found} == {"realistic"}
    # The target is stated for medium and large, and for at least a hundred logs.
    assert {c.size for c in found} == {"medium", "large"} and len(found) >= 100


def test_lists_and_single_names_are_taken(auvnn):
    words = ["effects=[ocean_current,nothing]", "sizes=[small,large]", "noises=none", "repeats=2"]
    status, out, _ = auvnn("benchmark", *words, "--cfg", "job")
    assert status == 0
    found = [(c.hidden, c.size, c.noise, c.seed) for c in cases(yaml.safe_load(out))]
    away = apart("ocean_current")
    assert found == [
        *(
            ("ocean_current", size, "none", away + seed)
            for size in ("small", "large")
            for seed in (1000, 1001)
        ),
        *(("nothing", "none", "none", seed) for seed in (1000, 1001)),
    ]


def test_a_dry_run_says_what_it_would_write(auvnn):
    status, out, err = auvnn("benchmark", *TINY, "out=out", "dry_run=true")
    assert (status, err) == (0, "")
    assert (
        "would write  benchmark.json, rows.jsonl, report.html, figures/ in out" in out
        and not Path("out").exists()
    )


def test_misspelt_words_are_refused(refused):
    assert "'repeats'" in refused("benchmark", "repeets=1")
    line = refused("benchmark", *TINY[1:], "effects=[net_bouyancy]", "out=out")
    assert "'net_bouyancy'" in line and "'net_buoyancy'" in line
    assert not Path("out").exists()


# .ci/run goes this way with the reduced plan.
@pytest.mark.long
def test_one_log_from_the_command_line_to_the_report(auvnn):
    status, out, err = auvnn("benchmark", *TINY, "out=out")
    assert status == 0 and "Traceback" not in err
    assert {p.name + "/" * p.is_dir() for p in Path("out").iterdir()} - {".hydra/"} == set(
        VERBS.get("benchmark").writes
    )
    answer = json.loads(Path("out/benchmark.json").read_text())
    assert answer["schema"] == "auvnn/benchmark/1"
    assert answer["metrics"]["logs"] == 1 and answer["metrics"]["faults"] == 0
    (row,) = answer["rows"]
    assert (row["hidden"], row["size"], row["runs"], row["duration"]) == ("net_buoyancy", "medium", 2, 20.0)
    (line,) = answer["table"]
    named = f"{line['named_first']} of 1 named first"
    assert any(said.startswith("net_buoyancy") and named in said for said in out.splitlines())
    assert "result    logs 1" in out and "result    faults 0" in out
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert f"In {line['named_first']} of 1" in page and "could not be drawn" not in page
    assert {"confusion.png", "recovery.svg"} <= {p.name for p in Path("out/figures").iterdir()}


def test_whoever_ends_it_is_told_that_it_goes_on(auvnn, monkeypatch):
    from auvnn.studies import benchmark as study

    def interrupted(case):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "run_case", interrupted)
    status, out, err = auvnn("benchmark", *TINY, "out=out")
    assert status == 130 and "the same command goes on" in err and "result" not in out


def test_every_option_that_says_which_logs_reaches_the_benchmark():
    """An option of the composed config that is neither handed on nor the command's own would change nothing."""
    own = {"plan", "any_code", "rows", "only_done", "defaults", "hydra"}
    options = read_yaml(config_dir() / "benchmark.yaml")
    assert {*options} - own == {*TAKEN}


@pytest.mark.parametrize(
    ("aim", "words"),
    [
        ({"share": 1.0, "hits": 4, "count": 4}, "4 of 4 (100 %)"),
        ({"share": 1 / 3, "hits": 10, "count": 30}, "10 of 30 (33.3 %)"),
        ({"share": 1.0183, "hits": None, "count": 5}, "1.018 (over 5)"),
        ({"share": None, "hits": None, "count": 0}, "unknown"),
    ],
)
def test_a_rate_is_told_as_a_count(aim, words):
    assert _counted(aim) == words
