"""Studies: the hidden-effect demo and benchmark, and the paper's case studies."""
