"""Running what was asked: one job or many.

`application` takes a verb's options and runs them as one `job`, or as many by `sweep`; `dry` finds out beforehand
whether the model and the logs could be used. `folder` takes the output folder for one run at a time and leaves it
complete or unchanged. `working` is the folder inside it in which a run does its work.
"""
