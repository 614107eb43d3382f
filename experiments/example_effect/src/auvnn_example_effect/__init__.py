"""Effects for auvnn from outside it."""
