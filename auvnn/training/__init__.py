"""Fitting of parameters: problems, schemes, histories, and checkpoints from which a fit resumes exactly."""

from auvnn.training.train import Training, train

__all__ = ["Training", "train"]
