"""What damping subnetworks have learned that is not damping.

`confounded_effects` asks which effects can account for the learned wrench; `network_posterior` says how well the
log determined it.
"""
