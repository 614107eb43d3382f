"""The answer of a diagnosis: its data (`answer`), its table of candidates (`table`), and its words (`words`).

`describe_parameters` states fitted parameters with units and standard deviations.
"""
