"""What kind of change was seen, when, and how large.

`change` watches the missing wrench sample by sample, and `blocks` collect the samples. `sensitivities` say how the
wrench would look had one effect or another changed, `change_statistics` keeps bounded statistics of both, and
`change_words` says the finding in words.
"""
