"""Which hypothesis to accept.

`choose` refits the leading effects; `model_comparison` compares them by evidence and fit; `predictive_density`
accepts one only where it improves the cross-validated predictive density of what was left out; `moved_by_unnamed` says
how far effects that no hypothesis has would move its values.
"""
