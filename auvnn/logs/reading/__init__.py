"""From files to runs.

`reading` calls the others in order: `recordings` make one table of a file with many topics, `mapping_file` gives its
columns their canonical names, units and axes, and `repairs` put stamps in order, mask void samples and split where
poses restart. What is missing is refused by `required`. `head` and `portions` read parts of long files by the same
steps.
"""
