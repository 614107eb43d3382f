"""Recordings of many topics, each with separate times, made into one table.

`assemble` asks `recorded_values` for the fields of each topic, `recorded_series` makes time series of them in our
frames, `stretches` finds where the recording holds together, and `rates` brings all to one set of rows.
`other_clocks` finds the offset of topics stamped by another computer. `several_rates` does the same as `rates` for
tables with empty cells.
"""
