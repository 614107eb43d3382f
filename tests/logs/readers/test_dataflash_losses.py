"""What an ArduPilot log says of its own losses."""

from __future__ import annotations

from functools import partial

import numpy as np

from auvnn.logs.readers.dataflash_losses import losses
from auvnn.logs.recording import Topic


def topic(name: str, **columns: list[float]) -> Topic:
    values = {n: np.array(v, dtype=float) for n, v in columns.items()}
    return Topic(name, "dataflash", np.arange(len(next(iter(values.values()))), dtype=float), values)


def told(**topics: list[Topic]) -> list:
    return losses({n: partial(dict, {t.name: t for t in found}) for n, found in topics.items()}, "a.BIN")


def test_a_counter_that_begins_anew_goes_on_counting():
    """5 before the reboot and 3 after it: 8 messages."""
    (found,) = told(DSF=[topic("DSF", Dp=[0, 2, 5, 0, 1, 3])])
    assert found.count == 8 and found.level == "warning" and "dropped" in found.what


def test_a_logger_that_kept_up_is_not_mentioned():
    assert told(DSF=[topic("DSF", Dp=[0, 0, 0])]) == []
    assert told(DSF=[topic("DSF", Blk=[1, 2])]) == [] and told(ATT=[]) == []


def test_resets_are_counted_core_by_core_with_the_largest():
    cores = [
        topic("XKF4[0]", OFN=[0, 0, 3.0, 3.0], OFE=[0, 0, 4.0, 4.0]),
        topic("XKF4[1]", OFN=[0, 1.0, 1.0, 1.0], OFE=[0, 0, 0, 0]),
    ]
    (found,) = told(XKF4=cores)
    assert found.count == 2 and "5 m" in found.what


def test_damaged_numbers_are_no_resets():
    assert told(XKF4=[topic("XKF4", OFN=[0, np.nan, 0], OFE=[0, np.inf, 0])]) == []
