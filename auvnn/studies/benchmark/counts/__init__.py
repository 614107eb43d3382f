"""The rows of a benchmark, counted.

`counting` says what one row is: right, in a group, tied, a false name; `worlds` does so where the model's assumptions
are broken. `rates` makes rates with intervals of them, and `power` the size at which an effect is found nine times in
ten. `summary` puts all of it together, part by part;
`entries` says which keys its entries have.
"""
