"""The verbs of the `auvnn` command, one file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

VERBS = Catalogue(
    "verb",
    {
        "check": "auvnn.cli.verbs.check:VERB",
        "simulate": "auvnn.cli.verbs.simulate:VERB",
        "train": "auvnn.cli.verbs.train:VERB",
        "compare": "auvnn.cli.verbs.compare:VERB",
        "diagnose": "auvnn.cli.verbs.diagnose:VERB",
        "add": "auvnn.cli.verbs.add:VERB",
        "improve": "auvnn.cli.verbs.improve:VERB",
        "remove": "auvnn.cli.verbs.remove:VERB",
        "export": "auvnn.cli.verbs.export:VERB",
        "import": "auvnn.cli.verbs.import:VERB",
        "adapt": "auvnn.cli.verbs.adapt:VERB",
        "fleet": "auvnn.cli.verbs.fleet:VERB",
        "demo": "auvnn.cli.verbs.demo:VERB",
        "app": "auvnn.cli.verbs.app:VERB",
        "study": "auvnn.cli.verbs.study:VERB",
        "benchmark": "auvnn.cli.verbs.benchmark:VERB",
    },
    "auvnn.verbs",
)
