"""Cross-validation: effects and what is uncertain are fitted without a part of the log, and run free over that part.

`folds` says which parts are left out in turn, `fitters` fits to all and to all but one of them, and `left_out` runs the
models over what they have not seen; `errors` holds what came of it, and by how much one model errs less than another.
"""
