"""Fossen's equations as pure functions of tensors: any leading shape, dtype and device of the inputs.

SI units and radians; body axes x forward, y starboard, z down; world axes north, east, down. Each equation
stands once, in the file of its subject: attitude, kinematics, inertia, coriolis, restoring, drag, current,
thrusters, fins, frames, energy.
"""
