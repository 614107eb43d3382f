"""What a log can tell of a hidden effect, whoever looks, with the truth known.

`information` computes the Fisher information of the model's own equations, `plant_information` that of the plant by
finite differences. `oracle` knows the laws of a world but not its coefficients: its derivatives are `oracle_slopes`,
and `oracle_filter` takes a force that wanders into account.
"""
