"""UUV Simulator's vehicles: signs, places and curves against a file worked out by hand, and bad files."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn import import_model
from auvnn.errors import InputError

URDF = """<?xml version="1.0"?>
<robot name="example_rov">
  <link name="base_link">
    <inertial>
      <origin xyz="0.01 0.02 0.03" rpy="0 0 0"/><mass value="100"/>
      <inertia ixx="5" ixy="0.1" ixz="0.2" iyy="6" iyz="0.3" izz="7"/>
    </inertial>
  </link>
  <joint name="one_joint" type="continuous">
    <origin xyz="-0.5 0.3 0.1" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/>
    <parent link="base_link"/><child link="one"/>
  </joint>
  <joint name="two_joint" type="continuous"><origin xyz="0 0 0.2" rpy="0 -1.5707963267948966 0"/></joint>
  <gazebo>
    <plugin name="water" filename="libuuv_underwater_object_ros_plugin.so">
      <fluid_density>1028</fluid_density>
      <link name="base_link">
        <neutrally_buoyant>0</neutrally_buoyant><volume>0.1</volume><center_of_buoyancy>0 0 0.3</center_of_buoyancy>
        <hydrodynamic_model>
          <type>fossen</type>
          <added_mass>50 0 0 0 2 0  0 60 0 -3 0 0  0 0 70 0 0 0  0 -3 0 5 0 0  2 0 0 0 6 0  0 0 0 0 0 7</added_mass>
          <linear_damping>-10 -20 -30 -4 -5 -6</linear_damping>
          <quadratic_damping>-100 -200 -300 -40 -50 -60</quadratic_damping>
          <linear_damping_forward_speed>-1 0 0 0 0 0</linear_damping_forward_speed>
        </hydrodynamic_model>
      </link>
    </plugin>
  </gazebo>
  <gazebo>
    <plugin name="t1" filename="libuuv_thruster_ros_plugin.so">
      <jointName>one_joint</jointName><clampMin>-50</clampMin><clampMax>100</clampMax>
      <dynamics><type>FirstOrder</type><timeConstant>0.2</timeConstant></dynamics>
      <conversion><type>Basic</type><rotorConstant>0.01</rotorConstant></conversion>
    </plugin>
    <plugin name="t2" filename="libuuv_thruster_ros_plugin.so">
      <jointName>two_joint</jointName>
      <dynamics><type>FirstOrder</type><timeConstant>0.2</timeConstant></dynamics>
      <conversion>
        <type>LinearInterp</type><inputValues>-20 0 20</inputValues><outputValues>-30 0 40</outputValues>
      </conversion>
    </plugin>
    <plugin name="t3" filename="libuuv_thruster_ros_plugin.so">
      <jointName>two_joint</jointName><conversion><type>Basic</type><rotorConstant>0.01</rotorConstant></conversion>
    </plugin>
  </gazebo>
</robot>
"""


@pytest.fixture
def put(tmp_path):
    def write(text):
        path = tmp_path / "vehicle.urdf"
        path.write_text(text)
        return path

    return write


def test_geometry_is_turned_and_derivatives_are_not(put):
    found = import_model(put(URDF))
    v = found.vehicle
    assert (v.name, v.mass, found.source) == ("example_rov", 100.0, "uuv")
    assert np.allclose(v.center_of_gravity, [0.01, -0.02, -0.03])
    assert np.allclose(v.center_of_buoyancy, [0, 0, -0.3])
    assert v.buoyancy == pytest.approx(0.1 * 1028 * 9.81)
    # Half a turn about x turns the signs of the products with x, not of that of y and z.
    assert np.allclose(v.inertia, [[5, -0.1, -0.2], [-0.1, 6, 0.3], [-0.2, 0.3, 7]])
    # The simulator evaluates the hydrodynamics with z down: as they stand.
    assert v.added_mass[0, 4] == 2 and v.added_mass[1, 3] == -3
    assert np.allclose(np.diag(v.linear_damping), [10, 20, 30, 4, 5, 6])
    assert np.allclose(np.diag(v.quadratic_damping), [100, 200, 300, 40, 50, 60])
    one, two = v.thrusters
    assert np.allclose(one.position, [-0.5, -0.3, -0.1]) and np.allclose(one.direction, [0, -1, 0])
    assert (one.max_forward, one.max_reverse) == (pytest.approx(100.0), pytest.approx(25.0))
    assert np.allclose(two.direction, [0, 0, -1]) and two.curve.thrust.tolist() == [-30, 0, 40]
    assert v.effects == {"propeller_lag": {"time_constant": 0.2}}
    said = " ".join(found.unread)
    assert "linear_damping_forward_speed" in said and "two_joint: without clampMax" in said
    found.model.linearise(torch.zeros(12, dtype=torch.float64), torch.zeros(2, dtype=torch.float64))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('<mass value="100"/>', '<mass value="${mass}"/>', "none is evaluated here: expand the file first"),
        ('<mass value="100"/>', '<mass value="__import__(1)"/>', "holds '__import__"),
        ("<volume>0.1</volume>", "", "no <volume>"),
        ("-10 -20 -30 -4 -5 -6", "-10 -20", "has 2 numbers: 6 or 36 numbers are needed"),
        ("<type>fossen</type>", "<type>sphere</type>", "only fossen is read"),
        ("0.1</volume>", "nan</volume>", "holds 'nan'"),
        ("</robot>", "", "is not XML"),
        ('<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "c">]>', "document type or entities"),
        ("underwater_object", "something_else", "holds neither"),
        ('<link name="base_link">\n    <inertial>', '<link name="other">\n    <inertial>', "no link 'base_link'"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_in_one_line(put, old, new, words):
    assert old in URDF
    with pytest.raises(InputError, match=words) as caught:
        import_model(put(URDF.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_mutated_files_end_in_an_answer_or_in_one_line(put):
    """No other kind of error, whatever is changed."""
    from auvnn.errors import AuvnnError

    random = np.random.default_rng(0)
    refused = 0
    for _ in range(300):
        text = list(URDF)
        for _ in range(int(random.integers(1, 6))):
            at = int(random.integers(len(text)))
            text[at : at + int(random.integers(0, 4))] = random.choice(
                list('<>/"= 0129-.e$x'), int(random.integers(0, 3))
            )
        try:
            import_model(put("".join(text)))
        except AuvnnError as no:
            refused += 1
            assert "\n" not in str(no)
    assert 100 < refused < 300


def test_there_must_be_a_file(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        import_model(tmp_path / "none.sdf")
    with pytest.raises(InputError, match="is a folder"):
        import_model(tmp_path)
