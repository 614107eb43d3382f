"""The likelihood of a law of the stochastic force, and what it is made of.

`sums` holds what windows say of parameters, states and force; `window_filter` takes them one after the other, conditional
on those before; `law_likelihood` is the likelihood of a law, `law_information` how curved it is, and `estimate_law`
makes it as large as it can be, by the steps of `bounded_minimum`.
`about_motion` linearises the windows about the trajectories that are known from the past.
"""
