"""The figures of what goes in: a `log` over time, and a `model` by its effects and its damping."""
