"""Diagnosis of logs larger than memory.

`large_logs` searches on a sample and puts the answer to all data; `map_reduce` runs over all chunks and adds their
sums; `full_data` tests and refits by these sums.
"""
