"""Training on more samples than fit into memory.

`data_split` says which pieces are fitted, validated and held out, `target_cache` keeps targets on the disk,
`distributed_problem` spreads a fit over workers by `requests`, and `grouped_sums` adds what they answer so that
the last bit does not depend on them.
"""
