"""`auvnn check`: what was read, repaired, implausible and excited in a log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from auvnn.cli.notes import once
from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb, files

_STYLE = {"error": "red", "warning": "yellow"}


def _looked(job: Job) -> list[dict[str, object]]:
    """Say what the topics of recordings hold and which mapping would read them; write it where that was asked."""
    from auvnn.logs.inspect_file import look, write_mapping
    from auvnn.logs.readers import choose
    from auvnn.logs.readers.recordings import RecordingReader

    found = []
    for path in files(job.options, "log"):
        if job["mapping_out"] is None and not isinstance(choose(path)[0], RecordingReader):
            continue
        seen = look(path)
        found.append(seen.to_dict())
        job.say(f"format    {path}: {seen.format}")
        for line in seen.lines():
            job.say(
                line, style=_STYLE.get({"refused": "error", "lacking": "warning"}.get(line.split()[0], ""))
            )
        if job["mapping_out"] is not None and len(found) == 1:
            written = write_mapping(
                seen, Path(str(job["mapping_out"])).expanduser(), job["overwrite"] is True
            )
            job.say(f"mapping   written to {written}")
            if job["mapping"] is None:
                job.options["mapping"] = str(written)
        elif job["mapping"] is None and seen.proposal.mapping["columns"] and len(found) == 1:
            job.say(
                "mapping   write the one that is proposed, to look at or to change, with mapping_out=map.yaml"
            )
    return found


def _run(job: Job) -> Answering:
    looked = _looked(job)
    log = job.log(repairs=False, partial=True)  # repairs are findings too
    if job["seal"]:
        from auvnn.logs.seal import file_hash, write_seal

        for path in log.paths:
            job.say(f"sealed    {write_seal(path, file_hash(path))}")
    quality = log.quality()
    if looked:
        quality = replace(quality, files=looked)
    from auvnn.checks import check_actuators, unmeasured

    quality = quality.with_notes("not measured", unmeasured.words(log, job["model"] is not None))
    if job["model"] is not None and not log.unmeasured:
        quality = quality.with_actuators(check_actuators(job.model(log), log))
    quality.write(job.folder)
    findings = quality.findings
    for first, words in once(findings):
        cure = f"; {first.cure}" if first.cure else ""
        job.say(f"{first.level:<9} {words}{cure}", style=_STYLE.get(first.level))
    if not findings:
        job.say("result    nothing to complain of")
    if quality.actuators is not None:
        for line in quality.actuators["story"]:
            job.say(f"actuators {line}")
    return quality


VERB = Verb(
    "quality report of a log: what was read, repaired, implausible, excited", ("log", "mapping", "model"),
    ("quality.json", "report.html", "figures/"), _run, dry_run=check_inputs,
)  # fmt: skip
