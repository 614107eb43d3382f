"""What a stand-in for a verb does: it reads nothing and writes two files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import auvnn
from auvnn.cli.runs.job import Job

# For other processes in other folders: the package that is under test here, installed or not.
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(auvnn.__file__).parents[1])}


class Plain:
    def __init__(self, **data: Any) -> None:
        self.data = data

    def to_dict(self) -> dict[str, Any]:
        return self.data


def write_two(job: Job) -> Plain:
    (job.folder / "quality.json").write_text(f"{job['mapping']}")
    (job.folder / "figures").mkdir()
    (job.folder / "figures" / f"{job['mapping']}.png").write_text("figure")
    job.say("read it")
    return Plain(schema="test/1", mapping=job["mapping"])
