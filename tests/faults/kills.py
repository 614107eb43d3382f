"""SIGKILL at random times over the verbs that work long: what lies there afterwards, and what the next run makes of it.

Each command runs in a child that is forked from a process in which everything is loaded, so that the times of the kills
fall on the work and not on imports. `python -m tests.faults.kills 200` prints a line for each verb.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from auvnn.models import load

WORK = ".auvnn"
EFFECT = "net_buoyancy"
SMALL = [
    "costs=false",
    "max_effects=1",
]
LOADED = (
    "auvnn.cli.main", "auvnn.training", "auvnn.improvement", "auvnn.diagnosis", "auvnn.report", "auvnn.studies.benchmark",
)  # fmt: skip
# Verb: its words beside out=; whether it goes on where it stopped; its share of the kills.
VERBS: dict[str, tuple[list[str], str, float]] = {
    "train": (["scheme.restarts=2", "scheme.max_iterations=12", "damping.hidden=2"], "", 0.15),
    "train, resumed": (["scheme.restarts=2", "scheme.max_iterations=12", "damping.hidden=2"], "resume", 0.2),
    "add": ([f"effect={EFFECT}"], "", 0.15),
    "diagnose": ([f"effects=[{EFFECT}]", *SMALL], "", 0.15),
    "improve": ([f"effects=[{EFFECT}]", "learn=[]", "max_effects=1", "seconds=20"], "", 0.1),
    "fleet": ([f"effects={EFFECT}"], "", 0.1),
    "benchmark": (
        [f"effects=[{EFFECT}]", "repeats=2", "sizes=medium", "duration=10", "runs=2", "rate=10", "workers=1",
         f"candidates=[{EFFECT}]", "costs=false"],
        "again", 0.1,
    ),
    "app": ([], "", 0.05),
}  # fmt: skip


@dataclass
class Told:
    """What came of the kills of one verb.

    Attributes:
        kills: that hit a running process.
        finished: runs that were over before.
        former: kills after which every file was the former one.
        new: after which all was already the new answer.
        mixed: that fell into the exchange, file by file: each file whole, some of them new.
        resumed: chains of kills and resumptions that ended like the uninterrupted run, bit for bit.
        seconds: that the run takes uninterrupted.
    """

    kills: int = 0
    finished: int = 0
    former: int = 0
    new: int = 0
    mixed: int = 0
    resumed: int = 0
    seconds: float = 0.0
    notes: list[str] = field(default_factory=list)


def forked(call: Callable[[], int], log: Path) -> int:
    """Start a call in a child with a separate process group, and return its number."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid:
        return pid
    status = 70
    try:
        os.setsid()
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(out, stream)
        status = call()
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException as fault:
        os.write(2, f"{type(fault).__name__}: {fault}\n".encode())
    finally:
        os._exit(status)


def ended(pid: int, seconds: float) -> int | None:
    """Wait for a child so long; return its status, or None while it runs."""
    end = time.monotonic() + seconds
    while True:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= end:
            return None
        time.sleep(0.002)


def killed(call: Callable[[], int], after: float, log: Path) -> int | None:
    """Run a call and kill it after so many seconds; return its status if it was over before."""
    pid = forked(call, log)
    status = ended(pid, after)
    if status is None:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        quiet(pid, log)
    return status


def quiet(group: int, log: Path, seconds: float = 30.0) -> None:
    """Insist that nothing of a killed run goes on working."""
    end = time.monotonic() + seconds
    while True:
        try:
            os.killpg(group, 0)
        except (ProcessLookupError, PermissionError):
            return
        if time.monotonic() > end:
            os.killpg(group, signal.SIGKILL)
            raise AssertionError(f"processes of a killed run go on: {log.read_text()[-500:]}")
        time.sleep(0.05)


def cli(*words: str) -> Callable[[], int]:
    """A command line, as a call."""

    def run() -> int:
        from auvnn.cli.main import main

        torch.set_num_threads(1)
        return main(words)

    return run


def held(folder: Path) -> dict[str, str]:
    """SHA-256 of each file of an answer, by name."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and WORK not in p.relative_to(folder).parts
    }


def whole(folder: Path) -> None:
    """Insist that no file of an answer is half-written."""
    for name in held(folder):
        path = folder / name
        data = path.read_bytes()
        if path.suffix == ".json":
            json.loads(data)
        elif path.suffix == ".jsonl":
            assert all(json.loads(line) for line in data.splitlines()) and data.endswith(b"\n"), path
        elif path.suffix == ".html":
            assert data.rstrip().endswith(b"</html>"), path
        elif path.suffix == ".png":
            assert b"IEND" in data[-12:], path
        elif path.suffix == ".pdf":
            assert b"%%EOF" in data[-10:], path
        else:
            assert data, path
    for manifest in folder.rglob("manifest.json"):
        if WORK not in manifest.relative_to(folder).parts and (manifest.parent / "model.yaml").exists():
            load(manifest.parent)


def same_numbers(a: Any, b: Any) -> bool:
    """Whether two answers say the same, times of the clock aside."""
    if isinstance(a, dict) and isinstance(b, dict):
        # The checksum of a row covers how long it took.
        other = ("path", "created", "costs", "sum")
        timed = {k for k in (*a, *b) if "second" in k or "time" in k or k in other}
        return a.keys() - timed == b.keys() - timed and all(
            same_numbers(a[k], b[k]) for k in a if k not in timed
        )
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same_numbers(x, y) for x, y in zip(a, b, strict=True))
    return a == b


def content(folder: Path, verb: str) -> Any:
    """What an answer must be again to the last bit: weights of a training, rows of a benchmark."""
    if verb == "benchmark":
        return [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    return hashlib.sha256((folder / "model" / "weights.safetensors").read_bytes()).hexdigest()


class Kills:
    """Kills one verb's runs.

    Args:
        place: folder to work in.
        name: of the verb, in `VERBS`.
        log: a small log.
        seed: of the times.
    """

    def __init__(self, place: Path, name: str, log: Path, seed: int = 0) -> None:
        """Run once without a kill: the reference, and the time that it takes."""
        self.name, self.verb = name, name.split(",")[0]
        self.place, self.random = place / name.replace(", ", "-"), np.random.default_rng([seed, len(name)])
        self.place.mkdir()
        self.said = self.place / "said.txt"
        words, self.way, _ = VERBS[name]
        logs = [] if self.verb == "benchmark" else ["model=rov95", f"log={log}"]
        self.words = [self.verb, *logs, *words]
        self.log, self.told = log, Told()
        self.reference = self.place / "reference"
        begin = time.monotonic()
        pid = forked(self.call(self.reference), self.said)
        assert ended(pid, 3600.0) == 0, self.said.read_text()[-2000:]
        self.told.seconds = time.monotonic() - begin

    def call(self, out: Path, *more: str) -> Callable[[], int]:
        """The command with an answer's folder."""
        if self.verb == "app":
            return lambda: app(self.log, out)
        return cli(*self.words, f"out={out}", *more)

    def moment(self) -> float:
        """A time for a kill: anywhere, and every third time near the end, where files are written."""
        late = self.random.random() < 1.0 / 3.0
        return float(self.told.seconds * self.random.uniform(0.85 if late else 0.0, 1.05))

    def go(self, count: int) -> Told:
        """Kill so often."""
        while self.told.kills < count:
            if self.way:
                self.chain(count)
            elif self.verb == "app":
                self.fresh()
            else:
                self.over()
        return self.told

    def over(self) -> None:
        """Kill a run that is to replace a former answer, which must be there afterwards, or the new one."""
        out = self.place / "out"
        if not out.exists():
            shutil.copytree(self.reference, out)
            (out / "dated.txt").write_text("what the user keeps beside it")
        before = held(out)
        status = killed(self.call(out, "overwrite=true"), self.moment(), self.said)
        self.counted(status)
        whole(out)
        after = held(out)
        assert after.get("dated.txt") == before["dated.txt"], "what was beside the answer is gone"
        if after == before:
            self.told.former += 1
        elif not (out / WORK / "old").exists():
            self.told.new += 1
            assert set(held(self.reference)) <= set(after), set(held(self.reference)) - set(after)
        else:
            self.told.mixed += 1
            # The kill fell between two files. The next run puts things right.
            pid = forked(self.call(out, "overwrite=true"), self.said)
            assert ended(pid, 3600.0) == 0, self.said.read_text()[-2000:]
            assert set(held(out)) == {*held(self.reference), "dated.txt"}

    def chain(self, count: int) -> None:
        """Kill, go on, kill again, until it is over; the end must be that of the uninterrupted run."""
        out = self.place / f"chain-{self.told.resumed}"
        more = ["resume=true"] if self.way == "resume" else []
        for _ in range(500):
            quick = self.told.kills < count
            status = killed(self.call(out, *more), self.moment() if quick else 3600.0, self.said)
            self.counted(status)
            if status == 0:
                break
            assert not out.exists() or not held(out), "an answer that is not complete"
        a, b = content(out, self.verb), content(self.reference, self.verb)
        assert same_numbers(a, b), "what was resumed is not what the uninterrupted run gives"
        whole(out)
        self.told.resumed += 1
        shutil.rmtree(out)

    def fresh(self) -> None:
        """Kill the page's server while somebody works on it and saves: all of the folder, or nothing."""
        out = self.place / "saved"
        status = killed(self.call(out), self.moment(), self.said)
        self.counted(status)
        if out.exists():
            held, wanted = ({p.name for p in f.iterdir()} for f in (out, self.reference))
            assert held == wanted, held ^ wanted
            whole(out)
            self.told.new += 1
            shutil.rmtree(out)
        else:
            self.told.former += 1

    def counted(self, status: int | None) -> None:
        """Count a kill, or a run that was over before."""
        if status is None:
            self.told.kills += 1
            return
        assert status == 0, self.said.read_text()[-2000:]
        self.told.finished += 1


def app(log: Path, folder: Path) -> int:
    """What a user does on the page: open a log, compare, add an effect, keep it, save."""
    from auvnn.app.session import Session
    from auvnn.app.web import Pages
    from tests.app.asking import ask

    work = Path(tempfile.mkdtemp(dir=folder.parent, prefix="work-"))
    session = Session(work, folder, "rov95")
    pages = Pages(session).app()

    def post(name: str, **body: Any) -> Any:
        status, _, answer = ask(pages, f"/api/{name}", "POST", body)
        assert status == 200, answer
        return answer

    def wait() -> None:
        while True:
            state = json.loads(ask(pages, "/api/state")[2])
            job, log = state["job"], state["log"]
            if not (job and job["state"] == "running") and not (log and log["ready"] and not log["judged"]):
                assert job is None or job["state"] == "done", job
                return
            time.sleep(0.05)

    post("open", path=str(log))
    wait()
    post("start", kind="compare")
    wait()
    post("start", kind="add", effects=[EFFECT], force=True)
    wait()
    post("keep")
    post("save", folder=str(folder))
    session.close()
    return 0


def small_log(folder: Path) -> Path:
    """Two runs of twelve seconds with something in them to be found."""
    from auvnn.simulation import simulate

    made = simulate(
        load("rov95"),
        "multisine",
        "realistic",
        {EFFECT: {"force": 15.0}},
        0,
        runs=2,
        duration=12.0,
        rate=10.0,
    )
    return made.log.write(folder / "dive.parquet")


def kill(count: int, place: Path, names: list[str] | None = None, seed: int = 0) -> dict[str, Told]:
    """Kill `count` runs in all, each verb by its share, and return what came of it."""
    torch.set_num_threads(1)
    for module in LOADED:
        importlib.import_module(module)
    # This process reads and writes no table: the threads that polars would start are not in its children.
    pid = forked(lambda: 0 if small_log(place) else 1, place / "said.txt")
    assert ended(pid, 600.0) == 0, (place / "said.txt").read_text()[-2000:]
    log, found = place / "dive.parquet", dict[str, Told]()
    for name in names or VERBS:
        if name == "app" and importlib.util.find_spec("starlette") is None:
            continue
        mine = Kills(place, name, log, seed)
        found[name] = mine.go(max(1, round(count * VERBS[name][2])))
        print(f"{name:<16} {found[name]}", flush=True)
    return found


def total(found: dict[str, Told]) -> Counter[str]:
    """Sum over the verbs."""
    return sum(
        (Counter({k: v for k, v in vars(t).items() if isinstance(v, int)}) for t in found.values()),
        Counter(),
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("AUVNN_ENGINE", "torch")
        print(json.dumps(total(kill(int(sys.argv[1]), Path(folder), sys.argv[2:] or None))))
