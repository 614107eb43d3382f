"""A user's own columns turned into the canonical ones, by data alone.

`columns` and `mapping_more` read the entries of a mapping file, `mapping` applies them to a table. `frames` turns FLU
into FRD and ENU into NED; `in_world` does what needs whole runs: headings set right, velocities turned into the body.
`suggest` says which column of a file a missing one might be.
"""
