"""Windows in which a stochastic force acts: it is integrated out together with their initial states.

`columns` says where the force stands among what a window answers, cell by cell, and `sums` eliminates it.
"""
