"""Windows whose commands change between the log's samples.

`paths` makes windows of commands that go along a line or a cubic, or change early, `mean_thrust` takes the curves of
thrusters for that into account, and `stated` does it as a model states it.
"""
