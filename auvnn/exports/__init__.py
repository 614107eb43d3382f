"""Models out: into code, simulators and controllers, each saying in words what it cannot hold."""

from auvnn.exports.export import Export, export
from auvnn.exports.targets import TARGETS

__all__ = ["TARGETS", "Export", "export"]
