"""From files to runs.

`reading` calls the others in order: a reader's table is mapped (`mapping`, `frames`), its stamps put in order
(`clock`, `delays`), void samples masked (`validity`, `masks`, `cores`), attitudes made quaternions (`attitude`),
restarts split (`resets`), and what is missing or implausible refused (`required`, `suggest`, `plausible`). Each
step is counted as a `repair`; `head` and `portions` read parts of files.
"""
