"""Fitting of parameters: problems, schemes, histories, and checkpoints from which a fit resumes exactly."""

from auvnn.training.train import Training, train
from auvnn.training.train_files import train_files

__all__ = ["Training", "train", "train_files"]
