"""Levenberg-Marquardt and linear least squares for damping forms.

`batched` solves many small problems at once with normal equations of `networks` (several networks),
`shared_network` (one with several outputs) or `forms` (any other); `joint` fits all parameters of a module at
once, `linear` solves forms linear in theirs.
"""
