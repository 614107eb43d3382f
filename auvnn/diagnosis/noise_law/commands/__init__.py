"""Commands between samples: how they go there, and what that leaves open.

A `law` says how they go. `holding` asks the log for it, `stated` has that of the model, `share` asks once more of a fit
to such commands, and `early` says whether the answer is so clear that names need not be sought with held ones
(`auvnn.metrics.commands` makes windows of commands that go so); `uncertain` says how much of a force that leaves open,
`in_place_of_names` which names another law of the commands replaces, and `later` which only say that commands act later
by part of an interval.
"""
