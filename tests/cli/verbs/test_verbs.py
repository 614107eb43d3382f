"""Each verb once, on a small log, from the command line to the files that it leaves."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from auvnn.cli.main import VERBS, main
from auvnn.cli.speech import Speaker
from auvnn.comparison import compare
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.models import load

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with a hidden current, 3 runs of 15 s."""
    out = tmp_path_factory.mktemp("made") / "simulate"
    words = [
        "hidden={ocean_current: {v_north: 0.3, v_east: -0.2}}",
        "runs=3",
        "duration=15",
        "rate=10",
        "noise=none",
    ]
    assert main(["simulate", "model=rov95", *words, f"out={out}"]) == 0
    return out


@pytest.fixture
def report(auvnn: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., dict]:
    """Run a verb and return its JSON, after looking at all that it left."""
    monkeypatch.chdir(tmp_path)

    def run(verb: str, *words: str) -> dict:
        status, out, err = auvnn(verb, *words, "out=out")
        assert (status, err) == (0, "")
        writes = VERBS.get(verb).writes
        left = {p.name + "/" * p.is_dir() for p in Path("out").iterdir()} - {".hydra/"}
        assert left == set(writes)
        assert f"written   {', '.join(writes)} in out" in out
        if "report.html" in writes:
            assert "<html" in Path("out/report.html").read_text(encoding="utf-8")
            assert out.splitlines()[-1] == f"report    {Path('out/report.html')}"
        answers = [json.loads(p.read_text()) for p in Path("out").glob("*.json")]
        return answers[0] if answers else {}

    return run


def test_simulate(made):
    truth = json.loads((made / "truth.json").read_text())
    assert truth["schema"] == "auvnn/truth/1" and truth["seed"] == 0 and truth["noise"] == "none"
    assert truth["hidden"]["ocean_current"] == {"v_north": 0.3, "v_east": -0.2, "v_down": 0.0}


def test_the_same_seed_makes_the_same_log(auvnn, tmp_path):
    words = ["simulate", "model=rov90", "hidden=[net_buoyancy]", "runs=1", "duration=5"]
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert auvnn(*words, f"seed={seed}", f"out={tmp_path / name}")[0] == 0
    a, b, c = ((tmp_path / name / "log.parquet").read_bytes() for name in "abc")
    assert a == b != c


def test_accelerations_are_written_where_asked_for_with_the_noise_that_the_condition_says(auvnn, tmp_path):
    words = ["simulate", "model=rov90", "runs=1", "duration=4"]
    more = {
        "estimated": ["noise=realistic"],
        "exact": ["noise=realistic", "accelerations=true"],
        "noisy": ["noise=realistic", "accelerations=true", "+noise.standard_deviation.du=0.5"],
        "left": ["noise=paper", "accelerations=false"],
        "paper": ["noise=paper"],
        "perfect": ["noise=none"],
    }
    runs = {}
    for name, extra in more.items():
        status, _, err = auvnn(*words, *extra, f"out={tmp_path / name}")
        assert (status, err) == (0, "")
        runs[name] = Log.read(tmp_path / name / "log.parquet").runs[0]
        truth = json.loads((tmp_path / name / "truth.json").read_text())
        assert truth["conditions"]["accelerations"] is (runs[name].nu_dot is not None)
    assert runs["estimated"].nu_dot is None and runs["left"].nu_dot is None
    np.testing.assert_array_equal(runs["exact"].nu_dot, runs["perfect"].nu_dot)
    np.testing.assert_array_equal(runs["noisy"].nu_dot[:, 1:], runs["exact"].nu_dot[:, 1:])
    for name, channel in (("noisy", 0), ("paper", 0)):
        spread = (runs[name].nu_dot - runs["exact"].nu_dot)[:, channel].std()
        assert spread == pytest.approx(0.5, rel=0.3)  # 81 draws: 8 % at one standard deviation


def test_a_shorter_step_of_the_integrator_gives_the_same_motion_closer(auvnn, tmp_path):
    words = ["simulate", "model=rov90", "runs=1", "duration=4", "noise=none"]
    runs = []
    for step in (0.05, 0.025, 0.00625):
        assert auvnn(*words, f"max_step={step}", f"out={tmp_path / str(step)}")[0] == 0
        runs.append(Log.read(tmp_path / str(step) / "log.parquet").runs[0].nu)
    coarse, fine = (np.abs(nu - runs[2]).max() for nu in runs[:2])
    assert 0.0 < fine < coarse / 8  # of fourth order: a sixteenth


def test_hidden_effects_of_a_size(auvnn, tmp_path):
    words = ["model=rov95", "hidden=[net_buoyancy]", "size=small,large", "runs=1", "duration=5"]
    assert auvnn("simulate", *words, f"out={tmp_path / 'sizes'}", "--multirun")[0] == 0
    truths = [json.loads((tmp_path / "sizes" / n / "truth.json").read_text()) for n in "01"]
    small, large = (abs(t["hidden"]["net_buoyancy"]["force"]) for t in truths)
    assert large == pytest.approx(6 * small, rel=1e-6)


def test_check(report, made):
    assert report("check", f"log={made / 'log.parquet'}")["schema"] == "auvnn/quality/1"


def test_compare(report, made):
    answer = report("compare", "model=rov95", f"log={made / 'log.parquet'}", "horizons=[1,5]")
    assert answer["schema"] == "auvnn/comparison/1"
    assert set(answer["rollout"]) == {"1", "5"}


def test_diagnose(report, made):
    words = ["model=rov95", "effects=[ocean_current,net_buoyancy]", "max_effects=1", "window=2.5"]
    answer = report("diagnose", f"log={made / 'log.parquet'}", *words)
    assert answer["schema"] == "auvnn/diagnosis/1"
    assert answer["missing"] == ["ocean_current"]
    assert {c["effect"] for c in answer["candidates"]} == {"ocean_current", "net_buoyancy"}
    # And the windows of free running have the length that was asked for.
    assert "free-running windows of 2.5 s" in answer["derivative"]["method"]


def test_adding_hands_the_length_of_windows_on(refused_after, made, monkeypatch):
    def tell(*_args, window, **_options):
        raise InputError(f"asked for {window} s")

    monkeypatch.setattr("auvnn.improvement.add", tell)
    words = ["model=rov95", f"log={made / 'log.parquet'}", "effect=ocean_current"]
    assert "asked for 2.5 s" in refused_after("add", *words, "window=2.5")
    assert "asked for None s" in refused_after("add", *words)


@pytest.mark.parametrize("verb", ["diagnose", "add"])
@pytest.mark.parametrize(
    ("window", "words"),
    [
        ("0", "above zero"),
        ("-2", "above zero"),
        ("long", "above zero"),
        ("true", "above zero"),
        (".inf", "above zero"),
        ("60", "longer than every run"),
    ],
)
def test_impossible_windows_are_refused(refused_after, made, verb, window, words):
    effect = "effect=ocean_current" if verb == "add" else "effects=[ocean_current]"
    line = refused_after(verb, "model=rov95", f"log={made / 'log.parquet'}", effect, f"window={window}")
    assert "window=" in line and words in line


def test_add_then_remove(report, auvnn, made):
    answer = report("add", "model=rov95", f"log={made / 'log.parquet'}", "effect=ocean_current")
    assert answer["schema"] == "auvnn/improvement/1" and answer["accepted"]
    assert answer["after"]["rollout"]["5"]["total"] < 0.1 * answer["before"]["rollout"]["5"]["total"]
    status, out, err = auvnn("remove", "model=out/model", "effect=ocean_current", "out=without", "json=true")
    assert (status, err) == (0, "") and json.loads(out)["removed"] == ["ocean_current"]
    status, _, err = auvnn("remove", "model=without/model", "effect=ocean_current", "out=again")
    assert status == 2 and "ocean_current" in err
    after = compare(load("out/model"), Log.read(made / "log.parquet"), horizons=[5])
    assert after.rollout["5"]["total"] < 0.1
    words = ["add", "model=out/model", f"log={made / 'log.parquet'}", "effect=ocean_current", "out=anew"]
    status, _, err = auvnn(*words)
    assert status == 2 and "the model has ocean_current already: refit=true fits it anew" in err
    assert auvnn(*words, "refit=true")[0] == 0
    there, anew = (load(f"{folder}/model").effect("ocean_current").values() for folder in ("out", "anew"))
    assert there != anew and all(abs(there[n] - anew[n]) < 0.01 for n in there)


def test_add_says_which_effect_adds_nothing(auvnn, made, monkeypatch, tmp_path):
    """All together lower the error by far: it is one of them that is not accepted."""
    monkeypatch.chdir(tmp_path)
    words = ["model=rov95", f"log={made / 'log.parquet'}", "effect=[ocean_current,gyro_bias]", "out=both"]
    status, out, _ = auvnn("add", *words)
    assert status == 0
    (verdict,) = (line for line in out.splitlines() if line.startswith("result "))
    answer = json.loads(Path("both/improvement.json").read_text())
    assert (
        answer["by_effect"]["ocean_current"]["accepted"] and not answer["by_effect"]["gyro_bias"]["accepted"]
    )
    assert answer["gain"]["value"] > answer["gain"]["std"] and not answer["accepted"]
    assert "not accepted: gyro_bias" in verdict and "leave it out" in verdict
    assert "does not fall enough" not in verdict
    assert "gyro_bias is not known to improve the prediction" in out


def test_add_says_in_the_verdict_that_a_regression_still_predicts_better(auvnn, made, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    adding = importlib.import_module("auvnn.improvement.add")
    compared = adding.compare_with_baseline

    def halved(*arguments, **options):
        line = compared(*arguments, **options)
        return {**line, "total": 0.5 * line["model"]["total"]}

    words = ["model=rov95", f"log={made / 'log.parquet'}", "effect=ocean_current"]
    status, plain, _ = auvnn("add", *words, "out=plain")
    assert status == 0 and "still predict" not in plain
    monkeypatch.setattr(adding, "compare_with_baseline", halved)
    status, out, _ = auvnn("add", *words, "out=beaten")
    (verdict,) = (line for line in out.splitlines() if line.startswith("result "))
    assert status == 0 and "accepted, but mind: a plain regression" in verdict and "auvnn improve" in verdict


def test_train(report, made):
    answer = report("train", "model=rov95", f"log={made / 'log.parquet'}", "damping=polynomial")
    assert answer["schema"] == "auvnn/training/1" and answer["metrics"]


def test_an_interrupted_training_goes_on_to_the_same_end(auvnn, made, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words = ["train", "model=rov95", f"log={made / 'log.parquet'}", "scheme=sgd", "scheme.epochs=60"]
    assert auvnn(*words, "out=whole")[0] == 0

    def interrupt(self: Speaker, words: str) -> None:
        if "iteration 50" in words:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Speaker, "progress", interrupt)
        status, _, err = auvnn(*words, "out=parts")
    assert status == 130 and err.count("\n") == 1 and "out=parts resume=true" in err
    assert [p.name for p in Path("parts").iterdir()] == [".auvnn"]
    status, _, err = auvnn(*words, "out=parts")
    assert status == 2 and "resume=true" in err, "what was reached is not thrown away unasked"
    status, _, err = auvnn(*words, "scheme.learning_rate=0.5", "out=parts", "resume=true")
    assert status == 2 and "learning_rate" in err
    assert auvnn(*words, "out=parts", "resume=true")[0] == 0
    weights = [Path(out, "model", "weights.safetensors").read_bytes() for out in ("whole", "parts")]
    assert weights[0] == weights[1]
    assert not Path("parts/.auvnn").exists()


def test_a_folder_is_diagnosed_in_parts_where_that_is_asked_for(auvnn, made, monkeypatch, tmp_path):
    from auvnn.diagnosis.full_data import large_logs as many

    asked = {}

    def record(model, paths, effects, **options):
        asked.update(options, actuation=model.actuation, paths=paths, effects=effects)
        raise InputError("asked")

    monkeypatch.setattr(many, "diagnose_files", record)
    words = [
        "diagnose",
        "model=rov95",
        f"log={made}",
        "stream=true",
        "windows=all",
        "workers=2",
        f"out={tmp_path / 'o'}",
    ]
    assert auvnn(*words)[0] == 2
    assert (
        asked["paths"] == [made / "log.parquet"] and asked["actuation"] == Log.read(made / "log.parquet").kind
    )
    assert asked["windows"] is None and asked["leading"] == many.LEADING and asked["search"] == many.SEARCH
    assert asked["workers"] == 2 and asked["executor"] is None and asked["effects"] is None
    status, _, err = auvnn(*words, "max_duration=10")
    assert status == 2 and "stream=false" in err


def test_fleet(report, made, tmp_path):
    whole = Log.read(made / "log.parquet")
    for k, run in enumerate(whole.runs[:2]):
        Log.from_runs([run]).write(tmp_path / "dives" / f"{k}.parquet")
    words = ["model=rov95", "effects=[net_buoyancy]", f"log={tmp_path / 'dives'}", "window=3"]
    answer = report("fleet", *words)
    assert answer["schema"] == "auvnn/fleet/1" and answer["along"] == "dive"
    assert [d["dive"] for d in answer["dives"]] == [1, 2] and answer["trends"][0]["dives"] == 2


@pytest.mark.long
def test_demo_reduced(report, monkeypatch):
    from auvnn.studies import demo

    monkeypatch.setattr(demo, "DURATION", 15.0)
    monkeypatch.setattr(demo, "RUNS", 3)
    report("demo")
    for verb in ("check", "compare", "diagnose", "add"):
        assert (Path("out") / verb / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["model=rov59"], ["'rov59'", "'rov95'"]),
        (["model=nowhere/model.yaml"], ["nowhere"]),
        (["model=rov95", "horizons=[0]"], ["0"]),
        (["model=rov95", "horizons=[soon]"], ["soon"]),
        (["model=rov95", "derivative.metod=measured"], ["'derivative.method'"]),
        (["model=rov95", "derivative.method=spline"], ["spline", "local_polynomial"]),
    ],
)
def test_what_the_floors_below_refuse_is_one_line(refused_after, made, words, parts):
    line = refused_after("compare", f"log={made / 'log.parquet'}", *words)
    for part in parts:
        assert part in line


@pytest.mark.parametrize("verb", ["diagnose", "add"])
def test_unknown_effects_are_named_with_their_neighbours(refused_after, made, verb):
    key = "effects" if verb == "diagnose" else "effect"
    line = refused_after(verb, "model=rov95", f"log={made / 'log.parquet'}", f"{key}=[ocean_curent]")
    assert "'ocean_curent'" in line and "'ocean_current'" in line


def test_the_log_itself_is_no_test(refused_after, made):
    log = made / "log.parquet"
    refused_after("add", "model=rov95", f"log={log}", f"test={log}", "effect=ocean_current")


@pytest.mark.parametrize(
    ("word", "needed"),
    [
        ("accelerations=yes", "true or false"),
        ("accelerations=1", "true or false"),
        ("max_step=0", "max_step"),
        ("max_step=2", "max_step"),
        ("max_step=fine", "a number"),
    ],
)
def test_impossible_options_of_the_simulation_are_refused(refused_after, word, needed):
    assert needed in refused_after("simulate", "model=rov95", word)


def test_hidden_parameters_are_checked(refused_after):
    line = refused_after("simulate", "model=rov95", "hidden={ocean_current: {v_nort: 1}}")
    assert "'v_north'" in line
    assert "out of bounds" in refused_after(
        "simulate", "model=rov95", "hidden={ocean_current: {v_north: 99}}"
    )


@pytest.fixture
def refused_after(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[..., str]:
    """Run what is refused after something was read: nothing is left behind."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> str:
        line = refused(*words, "out=out")
        assert not Path("out").exists()
        return line

    return run


def test_a_manoeuvre_is_written_as_a_command_file(auvnn, tmp_path):
    words = [
        "model=rov95",
        "excitation=pulses",
        "noise=none",
        "runs=2",
        "duration=4",
        "rate=5",
        "commands=true",
    ]
    status, _, err = auvnn("simulate", *words, f"out={tmp_path / 'made'}")
    assert status == 0, err
    told = np.genfromtxt(tmp_path / "made" / "commands.csv", delimiter=",", names=True)
    log = Log.read(tmp_path / "made" / "log.parquet")
    assert told.dtype.names[:3] == ("run", "t", "thruster_1") and len(told) == log.samples
    np.testing.assert_allclose(told["thruster_2"][told["run"] == 1], log.runs[1].thrusters[:, 1])
