"""What stands after the verb, made into options.

`words` parts Hydra's flags from overrides, `compose` composes them with the configs and judges every key and value.
`suggestions` says what somebody may have meant where a key is unknown. `foreign` reads a folder of configs that may
come from a stranger as plain data, before anything of it is composed.
"""
