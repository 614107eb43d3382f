"""A cure's button does what the cure says: the same log, broken, is whole again after it."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.app.cures import buttons, changed, offered
from auvnn.errors import InputError
from auvnn.logs import Log
from tests.log_samples import frame, make_log


def _written(path, change):
    import polars as pl

    log = make_log(2)
    pl.concat(
        [change(frame(run).with_columns(pl.lit(run.number).alias("run"))) for run in log.runs]
    ).write_parquet(path)
    return path


def _errors(log: Log) -> list:
    return [f for f in log.quality().findings if f.level == "error"]


def test_a_whole_log_asks_for_nothing(tmp_path):
    assert not _errors(Log.read(_written(tmp_path / "a.parquet", lambda f: f)))


@pytest.mark.parametrize(("name", "factor"), [("r", -1.0), ("u", 100.0), ("z", -1.0), ("rates", 180 / np.pi)])
def test_the_button_mends_what_was_broken(tmp_path, name, factor):
    import polars as pl

    columns = ["p", "q", "r"] if name == "rates" else [name]
    path = _written(
        tmp_path / "broken.parquet", lambda f: f.with_columns([pl.col(c) * factor for c in columns])
    )
    mapping: dict = {}
    try:
        log = Log.read(path)
        assert _errors(log), "the check sees it"
    except InputError as refused:
        mapping = offered(str(refused), mapping) or {}
        log = Log.read(path, mapping)
    for _ in range(4):
        found = [f for f in log.quality().findings if f.level == "error"]
        offers = [b for f in found for b in buttons(f.where, f.what, f.cure) if "change" in b]
        if not offers:
            break
        # A depth that points up may be ENU as a whole, which comes first, or itself alone, which is so here.
        mapping = changed(mapping, offers[-1 if name == "z" else 0]["change"])
        log = Log.read(path, mapping)
    assert not _errors(log), [f.what for f in _errors(log)]
    whole = make_log(2).runs[0]
    np.testing.assert_allclose(log.runs[0].nu, whole.nu, rtol=2e-2, atol=2e-2)


def test_changes_add_up():
    once = changed({}, {"scale": {"u": 2.0}})
    assert once == {"columns": {"u": {"from": "u", "scale": 2.0}}}
    twice = changed(once, {"scale": {"u": 3.0}, "delay": {"u": 0.5}, "world": "ENU", "quaternion": "xyzw"})
    assert twice["columns"]["u"] == {"from": "u", "scale": 6.0, "delay": 0.5}
    assert twice["frame"] == {"world": "ENU"} and twice["quaternion"] == "xyzw"
    assert once["columns"]["u"]["scale"] == 2.0, "what was given is left alone"


def test_what_the_cures_offer():
    labels = {
        "frame: {world: ENU}, or scale: -1 for z in the mapping": 2,
        "quaternion: xyzw in the mapping": 1,
        "scale: -1 for qx, qy and qz in the mapping": 1,
        "consider the effect ocean_current": 1,
        "record a run in which the vehicle moves": 0,
        "correct with rates: deg (or angles: deg) in the mapping": 2,
    }
    for cure, count in labels.items():
        assert len(buttons("z", "is odd", cure)) == count, cure
    (turned,) = buttons("attitude", "", "scale: -1 for qx, qy and qz in the mapping")
    assert turned["change"] == {"scale": {"qx": -1.0, "qy": -1.0, "qz": -1.0}}
    (late,) = buttons(
        "clock", "u, v are stamped by another clock", "give them the delay in the mapping, u: {delay: 0.3}"
    )
    assert late["change"] == {"delay": {"u": 0.3, "v": 0.3}}


def test_an_offered_mapping_can_be_read(tmp_path):
    path = _written(
        tmp_path / "named.parquet",
        lambda f: f.rename({"t": "time [ms]", "u": "surge velocity", "r": "yaw rate (rad/s)"}),
    )
    with pytest.raises(InputError) as refused:
        Log.read(path)
    mapping = offered(str(refused.value), {})
    assert mapping is not None and mapping["time"] == {"unit": "ms"}
    assert Log.read(path, mapping).samples == make_log(2).samples
    assert offered("no log", {}) is None


def test_what_is_offered_for_one_thruster_counts_for_all():
    offer = "columns: {thruster_1: {from: ..., curve: {neutral: 1500, span: 400}}}"
    error = f"dive.csv: thruster_1 reaches 1900. Mapping: {offer}"
    mapping = offered(error, {"columns": {"thruster_2": {"from": "pwm"}}}, ["t", "thruster_1", "thruster_2"])
    curve = {"neutral": 1500, "span": 400}
    assert mapping == {
        "columns": {
            "thruster_1": {"from": "thruster_1", "curve": curve},
            "thruster_2": {"from": "pwm", "curve": curve},
        }
    }
