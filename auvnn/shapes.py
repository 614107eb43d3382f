"""Names for the shapes that travel through the library; leading dimensions are free and broadcast.

They document signatures and are checked at run time in the tests only. ``...`` stands for any leading
shape: none for one sample, ``(n,)`` for a log, ``(windows, steps)`` for rollouts.
"""

from __future__ import annotations

from jaxtyping import Bool, Float
from torch import Tensor

Scalar = Float[Tensor, "..."]
"""One number per sample: a mass in kg, a weight in N, a density in kg/m3."""

Number = float | int | Scalar
"""A plain number or one tensor number per sample."""

Vector3 = Float[Tensor, "... 3"]
"""A vector: a position in m, a velocity in m/s, a force in N, an angular rate in rad/s."""

Vectors3 = Float[Tensor, "... n 3"]
"""Vectors of n parts: positions or directions of thrusters or fins."""

EulerAngles = Float[Tensor, "... 3"]
"""Roll, pitch, yaw (phi, theta, psi) in rad, in the order Z-Y-X."""

Quaternion = Float[Tensor, "... 4"]
"""Unit quaternion (w, x, y, z) that turns body vectors into world (NED) vectors."""

Rotation = Float[Tensor, "... 3 3"]
"""Rotation matrix from body to world."""

Matrix3 = Float[Tensor, "... 3 3"]
"""A 3x3 matrix: an inertia tensor in kg m2, the axes of a drag element as columns."""

Matrix6 = Float[Tensor, "... 6 6"]
"""A 6x6 matrix over surge, sway, heave, roll, pitch, yaw: inertia, damping."""

Velocity = Float[Tensor, "... 6"]
"""Body velocity nu = [u v w p q r] in m/s and rad/s, or its rate in m/s2 and rad/s2."""

Wrench = Float[Tensor, "... 6"]
"""Body force and moment tau = [X Y Z K M N] about the origin CO, in N and N m."""

Six = Float[Tensor, "... 6"]
"""Six coefficients, one per degree of freedom."""

Pose6 = Float[Tensor, "... 6"]
"""Position and Euler angles eta = [x y z phi theta psi] in m and rad."""

Pose7 = Float[Tensor, "... 7"]
"""Position and quaternion eta = [x y z qw qx qy qz]."""

Pose7Rate = Float[Tensor, "... 7"]
"""Time derivative of a Pose7, in m/s and 1/s."""

PerPart = Float[Tensor, "... n"]
"""One number per thruster or fin: a command, a thrust in N, an angle in rad."""

Knots = Float[Tensor, "... k"]
"""The points of a table: rising commands, or the thrusts at them in N."""

FinFrame = Float[Tensor, "... n 2 6"]
"""Per fin the two rows that turn a velocity into the flow in the fin's plane."""

RestoringGain = Float[Tensor, "... 6 3"]
"""Matrix from the direction of down in body axes to the restoring wrench."""

Allocation = Float[Tensor, "... 6 n"]
"""Matrix from the thrusts of n thrusters, N, to the wrench."""

Flag = Bool[Tensor, "..."]
"""Yes or no per sample."""

Rows = Float[Tensor, "... t n"]
"""Numbers of n parts, row by row in time."""

RowShares = Float[Tensor, "... t #n"]
"""What belongs to the same rows, of each part or of all of them."""

StepShares = Float[Tensor, "... t-1 #n"]
"""What belongs to the steps from each row to the next, of each part or of all of them."""
