"""`auvnn remove`: a model without some of its effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb


@dataclass(frozen=True)
class _Removal:
    model: str
    removed: list[str]
    effects: list[str]

    def to_dict(self) -> dict[str, Any]:
        return {"schema": "auvnn/removal/1", "metrics": {}, **vars(self)}


def _run(job: Job) -> Answering:
    from auvnn.effects.acting_beside import in_words, needed_beside
    from auvnn.models import remove

    names = job.names("effect")
    rest = remove(job.model(), names)
    rest.save(job.folder / "model")
    left = list(rest.effect_names)
    job.say(f"result    without {', '.join(names)}; left: {', '.join(left) or 'none'}")
    for name in left:
        needed = needed_beside(name, left)
        if needed:
            job.say(f"note      {name} does nothing without {in_words(needed)}: remove it too")
    return _Removal(str(job["model"]), names, left)


VERB = Verb(
    summary="a model without some of its effects",
    reads=("model",),
    writes=("model/",),
    run=_run,
    dry_run=check_inputs,
)
