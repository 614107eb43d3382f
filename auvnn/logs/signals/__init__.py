"""Signals in numpy: derivatives, noise, lags, outliers, unbroken stretches, rotations.

None of these knows a log or a vehicle; reading and quality both use them.
"""
