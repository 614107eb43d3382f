"""A model integrated from a state under held commands.

`rollout` has `rollout_checks` look at what it was given, takes as many steps as `stiffness` asks for with a scheme of
`tableaus`, and asks `rate` for the derivative of the whole state. It ends a run at the `limits` of what is physical
and returns a `trajectory`; `excursions` says where the run left the velocities that the damping was trained on.
`torchdiffeq_solver` runs the same by an independent integrator.
"""
