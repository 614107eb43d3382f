"""Vehicles of other simulators in: their files as model files, with what could not be read said."""

from auvnn.imports.imported import Imported, import_model

__all__ = ["Imported", "import_model"]
