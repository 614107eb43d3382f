"""Weights that learning moves, and when they may be used.

`weights` writes the adjustable ones of all subnetworks as one matrix. `bounds` is the set that they may not leave.
`shadow` judges new weights on the samples that follow and takes them back, and `trial` lets them into use once they
have proved better.
"""
