"""Tables and sentences of which the larger pages are made.

`comparison_words`, `diagnosis_words`, `judged` and `quality_reading` serve the pages of the same names. `outcomes`
reads and counts the rows of a benchmark without trusting them. `benchmark_rates` and `benchmark_words` then say what
they show.
"""
