"""The law of what is not modelled: a stochastic force, and commands between samples."""
