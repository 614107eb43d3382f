"""Logs larger than memory, read in chunks.

A first scan plans chunks without keeping them: `windows` of free running for diagnoses, `samples` for training one
step ahead. Whoever works on a chunk reads its rows again; sums over chunks are added in the order of the chunks.
"""
