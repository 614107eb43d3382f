"""A pipe or a device is not replaced by a file that is written beside it and moved into its place."""

from __future__ import annotations

import os
import stat

import pytest

from auvnn.answers import write_text
from auvnn.errors import InputError
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.mark.parametrize("name", ["log.csv", "log.parquet", "words.txt"])
def test_a_pipe_stays_a_pipe(tmp_path, name):
    place = tmp_path / name
    os.mkfifo(place)
    with pytest.raises(InputError, match="a pipe or a device"):
        if name.endswith("txt"):
            write_text(place, "words")
        else:
            make_log(GreyBox(small_vehicle()), runs=1, duration=4.0).write(place, overwrite=True)
    assert stat.S_ISFIFO(place.stat().st_mode) and os.listdir(tmp_path) == [name]
