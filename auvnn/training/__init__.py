"""Fitting of parameters: problems, schemes, histories, and checkpoints from which a fit resumes exactly."""
