"""Files of our own formats, damaged at random, their checksums put right again: what a stranger would write.

A wrong checksum is refused before anything is read (`test_flips`), so that here the checksums of a folder are worked out
again after each change: what is read is what was damaged. `python -m tests.security.fuzz model 1000` prints the longest
time of a file, s, the largest memory, bytes, and how many were read anyway.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import AuvnnError
from auvnn.logs import Log
from tests.log_samples import frame, make_log, make_run
from tests.logs.mutants import mutate

Made = tuple[list[Path], Callable[[], Any]]

# Values that stand in for a value of a text: numbers that overflow, other kinds, much, nested, foreign.
ODD = [
    "1e999", "-1e308", ".nan", "-.inf", "1e-320", "0", "-1", "true", "null", "~", "''", '""', "[]", "{}", "[1, 2, [3]]",
    "{a: {b: {c: 1}}}", "!!python/object:os.system x", "&a [*a]", "<<: *a", "${oc.env:HOME}", "1" * 400, "x" * 5000,
    "[" * 500 + "]" * 500, "../../etc/passwd", "/dev/zero", "\x00", "\ud7ff", "2026-01-01", "0x10", "1_000", "- 1",
    "9223372036854775808", "-9223372036854775809", "[1.0, .inf, 2]", "NaN", "Infinity", "1e400",
]  # fmt: skip
MAPPING = (
    "columns:\n  u: {from: u, scale: 1.0, offset: 0.0}\n  thruster_1: {from: thruster_1, curve: {neutral: 0.0, span: "
    "1.0}}\nframe: {body: FRD, world: NED}\nangles: rad\nquaternion: wxyz\ntime: {unit: s}\n"
)
SDF = """<?xml version="1.0"?><sdf version="1.7"><model name="rov"><link name="base"><inertial><mass>95</mass>
<inertia><ixx>5</ixx><iyy>5</iyy><izz>5</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics"><link_name>base</link_name>
<xDotU>-50</xDotU><yDotV>-50</yDotV><zDotW>-80</zDotW><kDotP>-2</kDotP><mDotQ>-2</mDotQ><nDotR>-2</nDotR><xU>-60</xU>
<yV>-60</yV><zW>-60</zW><kP>-8</kP><mQ>-8</mQ><nR>-8</nR><xUabsU>-90</xUabsU></plugin></model></sdf>
"""


def reworded(content: bytes, random: np.random.Generator) -> bytes:
    """Return a text with one to three values, words or lines exchanged for odd ones."""
    text = content.decode("utf-8", "replace")
    for _ in range(int(random.integers(1, 4))):
        marks = [i for i, c in enumerate(text) if c in ":,[ \n="]
        if len(marks) < 2:
            break
        k = int(random.integers(len(marks) - 1))
        end = marks[min(k + int(random.integers(1, 3)), len(marks) - 1)]
        text = text[: marks[k] + 1] + str(random.choice(ODD)) + text[end:]
    return text.encode("utf-8", "surrogatepass")


def damaged(content: bytes, random: np.random.Generator, text: bool) -> bytes:
    """Return damaged bytes; of a text half of the time with odd values instead."""
    return reworded(content, random) if text and random.random() < 0.5 else mutate(content, random)


def resummed(folder: Path) -> None:
    """Write the checksums of a folder again, if its manifest is still one."""
    manifest = folder / "manifest.json"
    try:
        told = json.loads(manifest.read_bytes())
        for name in told["files"]:
            data = (folder / name).read_bytes()
            told["files"][name] = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
        manifest.write_text(json.dumps(told))
    except (ValueError, KeyError, TypeError, AttributeError, OSError, RecursionError):
        pass


def mapping(folder: Path) -> Made:
    """A mapping of columns, with a log for it."""
    path, log = folder / "map.yaml", folder / "dive.csv"
    path.write_text(MAPPING)
    frame(make_run(60)).write_csv(log)
    return [path], lambda: Log.read(log, path)


def vehicle(folder: Path) -> Made:
    """A vehicle's file."""
    from auvnn.config import config_dir
    from auvnn.models import load

    path = folder / "rov.yaml"
    path.write_bytes((config_dir() / "vehicle" / "rov95.yaml").read_bytes())
    return [path], lambda: load(path)


def model(folder: Path) -> Made:
    """A model's folder, with weights, an effect, a region and the limit of what was adapted."""
    from auvnn.damping.bank import DampingBank
    from auvnn.damping.region import Region
    from auvnn.models import GreyBox, load

    known = load("rov95", actuation="wrench").with_effects({"net_buoyancy": {"force": 3.0}})
    bank = DampingBank.from_description({"form": "mlp", "each": {"K": "zero", "M": "polynomial"}}, 0)
    bank.region, bank.passive = Region((-1.0,) * 6, (1.0,) * 6), True
    path = GreyBox(known.vehicle, known.copied_effects(), bank, "wrench").save(folder / "model")
    return sorted(path.iterdir()), lambda: load(path)


def state(folder: Path) -> Made:
    """An adapter's state."""
    from auvnn.online import Adapter
    from tests.online.online_world import driven, fed
    from tests.online.online_world import vehicle as known

    adapter = Adapter(known(), "rls", watch=True)
    fed(adapter, driven(known(), duration=3.0), range(25))
    path = adapter.save(folder / "state")
    return sorted(path.iterdir()), lambda: Adapter.restore(path)


def checkpoint(folder: Path) -> Made:
    """A training's checkpoint."""
    import torch

    from auvnn.training.checkpoint import Checkpoints

    states = Checkpoints(folder / "kept", {"fit": 1})
    expected = {"x": ((40,), torch.float64)}
    states.save(1, {"x": torch.arange(40.0, dtype=torch.float64)}, {"loss": 1.0})
    return sorted((folder / "kept" / "checkpoint-00000001").iterdir()), lambda: states.load(expected)


def journal(folder: Path) -> Made:
    """The rows of an unfinished benchmark, their checksums as they are: a line with another one is made again."""
    from auvnn.studies.benchmark import cases
    from auvnn.studies.benchmark.journal import Journal
    from tests.studies.benchmark.test_benchmark_running import OPTIONS, answered

    kept = Journal(folder / "rows.jsonl")
    todo = cases(OPTIONS)[:3]
    for case in todo:
        kept.append(answered(case))
    return [kept.path], lambda: kept.rows(todo)


def log(folder: Path) -> Made:
    """A log of our own."""
    path = make_log(2, n=120, noise=0.01).write(folder / "log.parquet")
    return [path], lambda: Log.read(path).quality().to_dict()


def table(folder: Path) -> Made:
    """A log of our own as text, without a seal."""
    path = make_log(2, n=60, noise=0.01).write(folder / "log.csv")
    seal = path.with_name("log.csv.sha256")
    seal.unlink(missing_ok=True)
    return [path], lambda: Log.read(path).quality().to_dict()


def seal(folder: Path) -> Made:
    """A seal."""
    path = make_log(1, n=60, noise=0.01).write(folder / "log.csv")
    place = path.with_name("log.csv.sha256")
    if not place.exists():
        from auvnn.logs.seal import file_hash, write_seal

        write_seal(path, file_hash(path))
    return [place], lambda: Log.read(path)


def config(folder: Path) -> Made:
    """A folder of configs, as `--config-dir` takes it."""
    from auvnn.cli.options.foreign import read_configs

    (folder / "configs").mkdir()
    path = folder / "configs" / "mine.yaml"
    path.write_text("# @package _global_\ndefaults:\n  - damping: mlp\nseed: 3\nscheme: {restarts: 2}\n")
    return [path], lambda: read_configs(folder / "configs")


def sdf(folder: Path) -> Made:
    """A simulator's model file."""
    from auvnn.imports.imported import import_model

    path = folder / "rov.sdf"
    path.write_text(SDF)
    return [path], lambda: import_model(path)


MAKERS: dict[str, Callable[[Path], Made]] = {
    "mapping": mapping, "vehicle": vehicle, "model": model, "adapter state": state, "checkpoint": checkpoint,
    "journal": journal, "log": log, "table": table, "seal": seal, "config folder": config, "sdf": sdf,
}  # fmt: skip
TEXTS = (".yaml", ".json", ".jsonl", ".csv", ".sdf", ".sha256")


def fuzz(kind: str, count: int, seed: int = 0) -> tuple[float, float, int]:
    """Read `count` damaged files; return the longest time, s, the memory, bytes, and how many were read anyway.

    Raises:
        AssertionError: a reader ended otherwise than with a result or one line.
    """
    import resource

    random = np.random.default_rng([seed, len(kind)])
    with tempfile.TemporaryDirectory() as place:
        files, read = MAKERS[kind](Path(place))
        read()
        whole = {path: path.read_bytes() for path in files}
        longest, good = 0.0, 0
        for k in range(count):
            path = files[int(random.integers(len(files)))]
            path.write_bytes(damaged(whole[path], random, path.suffix in TEXTS))
            if path.name != "manifest.json":
                resummed(path.parent)
            begin = time.perf_counter()
            try:
                read()
                good += 1
            except AuvnnError as problem:
                assert "\n" not in str(problem) and len(str(problem)) < 3000, problem
            except Exception as fault:
                raise AssertionError(
                    f"{kind} {k} ({path.name}): {type(fault).__name__}: {str(fault)[:300]}"
                ) from fault
            longest = max(longest, time.perf_counter() - begin)
            for each, data in whole.items():
                each.write_bytes(data)
        return longest, 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, good


if __name__ == "__main__":
    print(*fuzz(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0))
