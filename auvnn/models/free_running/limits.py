"""What counts as physical while a model runs free."""

# Beyond these speeds, m/s and rad/s, no underwater vehicle is meant: the integration has diverged.
LIMIT = 100.0
