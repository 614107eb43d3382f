"""The command line in this process, for the tests of what a stranger's files can and cannot do."""

from __future__ import annotations

from tests.command_line import auvnn, refused

__all__ = ["auvnn", "refused"]
