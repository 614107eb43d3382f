"""A model as a linear system at a state.

`state_space` writes the model as first-order equations, actuators included. `linearise` differentiates them: A and B
in continuous or in discrete time. This is what Kalman filters and regulators ask for.
"""
