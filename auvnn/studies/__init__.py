"""Studies: the hidden-effect demo and benchmark."""
