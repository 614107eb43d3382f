"""The law of what is not modelled: a stochastic force, and commands between samples.

Where a search leaves a force without a name, `answer` asks the log how commands go between samples (`command_holding`),
and `estimate_law` estimates the force's variance and correlation time from the windows' `sums`. `search` compares the
effects again, each as a `hypothesis` at the law that is most likely with it; `predicted_by_inputs` asks how much of what
is left measured inputs predict, and `words` puts it into words.
"""
