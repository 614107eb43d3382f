"""A plant with separate equations: vectors instead of matrices, scipy's integrator, nothing of the model's code."""

from auvnn.plants.independent.plant import NumpyPlant

__all__ = ["NumpyPlant"]
