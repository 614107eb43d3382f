"""The command line.

`main` takes the verb from the words and asks `verbs` for it; `overview` and `pages` answer what needs no run.
`options` composes what follows the verb into one checked set of options, `runs` runs each job of it in its own
folder. `speech` and `results` say in words what came out, `faults` turns what went wrong into one line and an exit
status.
"""
