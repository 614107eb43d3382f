"""The states of windows: where they begin, and the whole trajectories that measurements make likely.

`initial_states` fits where free running begins, and `initial_steps` takes steps of that window by window. With a
stochastic force, `smoothed_states` finds the likeliest trajectories and `filtered_states` those that are known from the
past alone.
"""
