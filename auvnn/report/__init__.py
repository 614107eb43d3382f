"""The floor that draws: plots (data in, Figure out), pages (an answer in, one self-contained HTML out)."""
