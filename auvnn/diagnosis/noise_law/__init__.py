"""The law of what is not modelled: a stochastic force, and commands between samples.

Where a search leaves a force without a name, `answer` asks the log how commands go between samples (`commands`), and
`likelihood` estimates the force's variance and correlation time from the parts of windows that `split_windows` makes.
`search` compares the effects again, each as a `hypothesis` at the law that is most likely with it: `leader_fits` says
which of them, and `law_fit` fits them under the law; `leaders` is about what the first search has found.
`free_running_cost` says what a name costs where the model runs free; `predicted_by_inputs` asks how much of what is left
measured inputs predict, and `words` puts it into words.
"""
