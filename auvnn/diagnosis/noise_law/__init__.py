"""The law of what is not modelled: a stochastic force, and commands between samples.

Where a search leaves a force without a name, `answer` asks the log how commands go between samples (`commands`), and
`likelihood` estimates the force's variance and correlation time from the parts of windows that `split_windows` makes.
`search` compares the effects again in `rounds`, each as a `hypothesis` at the law that is most likely with it, fitted
under the law by `law_fit`; `under_law` has what all of that shares, and `first_law` where it begins. `withheld` says
whether the names are given. `predicted_by_inputs` asks how much of what is left measured inputs predict, and `words` puts
it into words; `standing_names` asks whether names of the first search need no second one.
"""
