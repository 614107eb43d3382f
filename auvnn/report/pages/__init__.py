"""One file per kind of answer: which plots, which tables, and what they say in plain words."""
