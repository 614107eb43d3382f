"""`auvnn check` looks into recordings, proposes a mapping and writes it; a log without a DVL is looked at too."""

from __future__ import annotations

import json

import pytest

from auvnn.logs import Log
from tests.log_samples import frame, make_run
from tests.logs import foreign_formats as foreign

RUN = make_run(200)


def test_topics_mapping_and_quality(auvnn, tmp_path):
    pytest.importorskip("mcap_ros2")
    path = foreign.mcap(Log.from_runs([RUN]), tmp_path / "dive.mcap")
    out, wanted = tmp_path / "out", tmp_path / "map.yaml"
    status, said, err = auvnn("check", f"log={path}", f"out={out}", f"mapping_out={wanted}")
    assert (status, err) == (0, "")
    assert "topic     /odom nav_msgs/msg/Odometry (200 at 20 Hz): qw <- pose.pose.orientation.w" in said
    assert wanted.read_text().startswith("# Proposed for dive.mcap (mcap)")
    answer = json.loads((out / "quality.json").read_text())
    assert [t["topic"] for t in answer["files"][0]["topics"]] == ["/odom", "/thrusters"]
    status, _, err = auvnn("check", f"log={path}", f"out={tmp_path / 'again'}", f"mapping_out={wanted}")
    assert status == 2 and "is there already" in err
    status, _, err = auvnn(
        "compare", "model=bluerov2", f"log={path}", f"mapping={wanted}", f"out={tmp_path / 'c'}"
    )
    assert status == 2 and "thruster" in err  # four commands do not drive six thrusters


def test_a_table_with_other_names_gets_a_mapping(auvnn, tmp_path):
    table = frame(RUN).rename({"u": "surge", "v": "sway", "w": "heave"})
    table.write_csv(tmp_path / "dive.csv")
    wanted = tmp_path / "map.yaml"
    status, said, err = auvnn(
        "check", f"log={tmp_path / 'dive.csv'}", f"out={tmp_path / 'out'}", f"mapping_out={wanted}"
    )
    assert (status, err) == (0, ""), said
    assert "guessed" in said and "u: surge" in wanted.read_text()


def test_what_a_log_lacks_is_said(auvnn, tmp_path):
    frame(RUN).drop(["u", "v", "w"]).write_csv(tmp_path / "dive.csv")
    status, _, err = auvnn("check", f"log={tmp_path / 'dive.csv'}", f"out={tmp_path / 'out'}")
    assert (status, err) == (0, "")
    # One step ahead needs velocities; training on it is refused.
    status, _, err = auvnn(
        "train", "model=rov95", f"log={tmp_path / 'dive.csv'}", "objective=one_step", f"out={tmp_path / 'c'}"
    )
    assert status == 2 and "not measured" in err, err
