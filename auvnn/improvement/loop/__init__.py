"""The whole loop, every step accepted by free running on what was left out.

`improve` goes through the stages: `causes` checks, compares, refits and diagnoses (an `excerpt` of a long log),
`screen` promises which names would predict better, `learned` adds what has no name. Each of them makes `trials`,
whose model is a `state`, accepted by a `judge`. The `budget` judges every step once on data that chose nothing, and
the `answer` holds all.
"""
