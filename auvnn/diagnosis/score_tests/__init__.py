"""Score (Lagrange multiplier) tests of every effect at the null.

`null_tests` linearises a fit once and asks for all effects; `score` is the test with nuisance parameters projected
out. Effects without a slope at the null are asked for at several shapes by `probes`, and around the best of them
by `shape_search`.
"""
