"""Tests of what a hypothesis leaves.

`variance_component_test` asks whether a force without a name is left, `additive_force_test` (with `input_forces`) whether
it goes with a measured input, `attribution` on which inputs it depends, `autocorrelation` and `whiteness` whether it
is white noise.
"""
