"""A Slocum glider's file without its reader, and with a stand-in that gives what dbdreader does."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.readers import choose, slocum, slocum_worker

HEAD = b"dbd_label:    DBD(dinkum_binary_data)file\nencoding_ver:    5\nnum_ascii_tags:    14\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "unit-2016-174-05-001.dbd"
    path.write_bytes(HEAD + bytes(range(256)))
    return path


def test_it_is_known_by_its_content(file: Path) -> None:
    other = file.with_name("glider.bin")
    other.write_bytes(file.read_bytes())
    assert choose(file)[0].name == choose(other)[0].name == "slocum"


def test_without_the_reader_one_line_says_what_to_install(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *more: None if name == "dbdreader" else found(name, *more)
    )
    with pytest.raises(InputError) as told:
        Log.read(file)
    words = str(told.value)
    assert "\n" not in words and str(file) in words and "pip install dbdreader" in words


def test_with_it_sensors_are_topics_at_their_own_times(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the worker hands over is put on one clock; a sensor without a value is none."""
    t = 1.4667e9 + np.arange(5.0)
    arrays = {
        "m_depth|t": t, "m_depth|v": np.linspace(0, 4, 5), "m_pitch|t": t[1:], "m_pitch|v": np.full(4, -0.4),
        "m_roll|t": np.zeros(0), "m_roll|v": np.zeros(0),
    }  # fmt: skip
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: object())
    monkeypatch.setattr(slocum, "run_isolated", lambda *given: arrays)
    recording = slocum.SlocumReader().record(file)
    assert set(recording.topics) == {"m_depth", "m_pitch"}
    np.testing.assert_allclose(recording.topics["m_pitch"].t, [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(recording.topics["m_depth"].columns["value"], [0, 1, 2, 3, 4])


def test_all_sensors_are_asked_for_in_one_pass_of_the_file() -> None:
    """Hundreds of sensors one after the other took minutes of half a megabyte."""

    class Asked:
        calls = 0

        def get(self, *names: str, check_for_invalid_parameters: bool) -> list | tuple:
            self.calls += 1
            each = [(np.arange(k), np.full(k, float(k))) for k, _ in enumerate(names)]
            return each if len(names) > 1 else each[0]

    for count in (0, 1, 300):
        log = Asked()
        found = slocum_worker._all(log, [f"m_{k}" for k in range(count)])
        assert len(found) == count and log.calls == (count > 0)
        assert [len(t) for t, _ in found] == list(range(count))
