"""Quaternion helpers of the log floor against scipy's rotations."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from auvnn.logs.reading.mapping_file.frames import position_to_ned, quaternion_to_ned_frd, six_to_frd
from auvnn.logs.signals import rotation

WXYZ = [3, 0, 1, 2]
seeds = st.integers(0, 2**32 - 1)


def random_rotations(seed: int, n: int = 20) -> tuple[Rotation, np.ndarray]:
    turns = Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4)))
    return turns, turns.as_quat()[:, WXYZ]


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_products_and_turned_vectors(seed: int) -> None:
    a, qa = random_rotations(seed)
    b, qb = random_rotations(seed + 1)
    product = (a * b).as_quat()[:, WXYZ]
    ours = rotation.multiply(qa, qb)
    np.testing.assert_allclose(np.abs((ours * product).sum(axis=1)), 1.0, atol=1e-12)
    v = np.random.default_rng(seed).normal(size=(20, 3))
    np.testing.assert_allclose(rotation.rotate(qa, v), a.apply(v), atol=1e-12)
    np.testing.assert_allclose(rotation.rotate(rotation.conjugate(qa), v), a.inv().apply(v), atol=1e-12)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_euler_angles_both_ways(seed: int) -> None:
    turns, q = random_rotations(seed)
    ours = rotation.to_euler(q)
    np.testing.assert_allclose(ours, turns.as_euler("ZYX")[:, ::-1], atol=1e-7)
    back = Rotation.from_quat(rotation.from_euler(ours)[:, [1, 2, 3, 0]])
    assert (back * turns.inv()).magnitude().max() < 1e-7


def test_sign_flips_are_undone_across_missing_samples() -> None:
    t = np.linspace(0.0, 20.0, 200)
    truth = rotation.from_euler(np.stack([0.1 * t, 0.2 * np.sin(t), t], axis=1))
    truth = rotation.continuous(truth)
    flipped = truth * np.where(np.random.default_rng(0).random(200) < 0.3, -1.0, 1.0)[:, None]
    flipped[0] = truth[0]
    flipped[50:53] = np.nan
    result = rotation.continuous(flipped)
    good = np.isfinite(result).all(axis=1)
    assert good.sum() == 197
    np.testing.assert_array_equal(result[good], truth[good])


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_frames_keep_physics_the_same(seed: int) -> None:
    """A vector given in FLU and turned to ENU is the same arrow as its FRD twin turned to NED."""
    turns, q = random_rotations(seed)
    rng = np.random.default_rng(seed)
    six = rng.normal(size=(20, 6))
    to_enu = turns.apply(six[:, :3])
    frd = six_to_frd(six, "FLU")
    ned = rotation.rotate(quaternion_to_ned_frd(q, "FLU", "ENU"), frd[:, :3])
    np.testing.assert_allclose(ned, position_to_ned(to_enu, "ENU"), atol=1e-12)
    np.testing.assert_array_equal(six_to_frd(frd, "FLU"), six)
    np.testing.assert_array_equal(position_to_ned(position_to_ned(to_enu, "ENU"), "ENU"), to_enu)
    twice = quaternion_to_ned_frd(quaternion_to_ned_frd(q, "FLU", "ENU"), "FLU", "ENU")
    np.testing.assert_allclose(np.abs((twice * q).sum(axis=1)), 1.0, atol=1e-12)


def test_known_attitude_in_ros_frames() -> None:
    """Level and facing east: the identity in ENU/FLU, a yaw of 90 degrees in NED/FRD."""
    q = quaternion_to_ned_frd(np.array([[1.0, 0.0, 0.0, 0.0]]), "FLU", "ENU")
    np.testing.assert_allclose(rotation.to_euler(q), [[0.0, 0.0, np.pi / 2]], atol=1e-12)
    # Nose up in FLU is a negative turn about y, which points to port; in FRD pitch up is positive.
    nose_up = rotation.from_euler(np.array([[0.0, -0.3, 0.0]]))
    np.testing.assert_allclose(
        rotation.to_euler(quaternion_to_ned_frd(nose_up, "FLU", "ENU")), [[0.0, 0.3, np.pi / 2]], atol=1e-12
    )
