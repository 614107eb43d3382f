"""Windows reduced to what a fit or a test of many effects needs of them.

`kept_products` holds of each window those products of columns only that tests ask for, `sufficient_statistics` sums that
add up over the parts of a log which does not fit into memory.
"""
