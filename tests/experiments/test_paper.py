"""The paper's run: medians, and every seed's value kept, from answers that were written before."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "experiments" / "paper"


@pytest.fixture(scope="module")
def paper():
    spec = importlib.util.spec_from_file_location("paper_run", ROOT / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_medians_are_over_the_seeds_that_are_there_and_bad_ones_are_kept(paper, tmp_path, capsys):
    for seed, value in ((0, 0.5), (2, 0.25), (10, 40.0)):
        folder = tmp_path / "noisy" / str(seed)
        folder.mkdir(parents=True)
        metrics = {"guarded_frozen_over_offline": value, "follow_updates": 3, "unknown": None}
        (folder / "study.json").write_text(json.dumps({"metrics": metrics}))
    found = paper.table(tmp_path)
    entry = found["noisy"]["guarded_frozen_over_offline"]
    assert (entry["median"], entry["seeds"]) == (0.5, 3)
    assert entry["all"] == {"0": 0.5, "2": 0.25, "10": 40.0} and "unknown" not in found["noisy"]
    # Only what the table shows, by seed.
    assert paper.kept(found) == {"noisy": {"guarded_frozen_over_offline": {"0": 0.5, "2": 0.25, "10": 40.0}}}
    paper.show(found)
    lines = capsys.readouterr().out.splitlines()
    (row,) = [
        line for line in lines if "5 s ahead over offline, guarded" in line and line.startswith("noisy")
    ]
    assert "0.5" in row and "40" in row and row.endswith("met")
    assert any("not run" in line for line in lines)


def test_what_is_there_is_not_run_again_and_a_request_to_end_ends_all(paper, tmp_path, monkeypatch):
    (tmp_path / "noisy" / "0").mkdir(parents=True)
    (tmp_path / "noisy" / "0" / "study.json").write_text("{}")
    asked, answer = [], 0
    monkeypatch.setattr(paper, "main", lambda words: asked.append(words) or answer)
    paper.run(tmp_path, 2, ["only=noisy,payload_physical", "effort=smoke"])
    assert [words[1:3] for words in asked] == [
        ["case=payload", "case.variant=physical"], ["case=noisy", "seed=1"], ["case=payload", "case.variant=physical"]
    ]  # fmt: skip
    assert asked[0][3] == f"case.offline.model={tmp_path}/payload/0/model" and "report=false" not in asked[0]
    assert "report=false" in asked[1] and all(words[-1] == "effort=smoke" for words in asked)
    answer = 143
    with pytest.raises(SystemExit):
        paper.run(tmp_path, 2, [])


def test_the_kept_numbers_are_those_of_the_table(paper):
    kept = json.loads((ROOT / "expected.json").read_text())
    known = {(name, key) for name, key, *_ in paper.TARGETS}
    found = {(name, key) for name, keys in kept.items() if name != "how" for key in keys}
    assert found and found <= known
