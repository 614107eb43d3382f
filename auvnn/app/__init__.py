"""The loop as a page on this machine: look at a log, see where a model fails, name what is missing, try it, save it.

The page is a thin shell over the same Python calls as the commands: `Log.read`, `quality`, `compare`, `diagnose`,
`add`, `rollout`. It adds no physics and no statistics. What takes long runs in a child process
(`jobs`), which can be stopped; what must follow a slider runs in the server (`trial`), by the compiled engine.

The server answers this machine alone: it listens on the loopback address, each address begins with a random token,
host and origin are checked (`guard`), and the page asks no other host for anything.
"""
