"""Rounds of the search beside a stochastic force: which effects are fitted, and which of them may be named.

`leaders` says which effects lead, `leader_fits` fits them, `names_given` says which of the fits may be named,
`free_running_cost` what a name costs where the model runs free, and `looking_ahead` with which name to begin.
`name_after_name` goes from round to round along a `path`, and `beside_all_names` compares the names again at its end.
"""
