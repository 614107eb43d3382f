"""`auvnn app`: the loop as a page on this machine."""

from __future__ import annotations

import os

from auvnn.cli.runs.job import Answering, Job, Verb, files


def _run(job: Job) -> Answering:
    from auvnn.app.serve import serve
    from auvnn.config import read_yaml
    from auvnn.models import load

    model, mapping = job["model"], job.mapping()
    if model is not None:
        model = os.path.expanduser(str(model))
        load(model)  # a name or a file that is wrong is said here and not on the page
    job.say("this machine alone can open the page; Ctrl-C ends it")
    return serve(
        job.out,
        model=model,
        log=files(job.options, "log") if job["log"] is not None else (),
        mapping=None if mapping is None else read_yaml(mapping),
        test=files(job.options, "test") if job["test"] is not None else (),
        max_duration=job["max_duration"],
        port=job["port"],
        browser=job["browser"],
        say=lambda line: print(line, flush=True),
    )


VERB = Verb(
    summary="the loop as a page on this machine: look, compare, name, try, save",
    reads=("log", "mapping", "model", "test"),
    writes=(),
    run=_run,
)
