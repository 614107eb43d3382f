"""One file per kind of answer: which plots, which tables, and what they say in plain words.

Each page takes the answer of one verb or study and returns plots, tables and sentences; `common` holds what several
pages say in the same words. `sections` holds the tables and sentences of the larger pages. `demo` puts four pages on
one.
"""
