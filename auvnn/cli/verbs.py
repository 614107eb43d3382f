"""The verbs of the `auvnn` command, one file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

VERBS = Catalogue(
    "verb",
    {
        "check": "auvnn.cli.check:VERB",
        "simulate": "auvnn.cli.simulate:VERB",
        "train": "auvnn.cli.train:VERB",
        "compare": "auvnn.cli.compare:VERB",
        "diagnose": "auvnn.cli.diagnose:VERB",
        "add": "auvnn.cli.add:VERB",
        "improve": "auvnn.cli.improve:VERB",
        "remove": "auvnn.cli.remove:VERB",
        "export": "auvnn.cli.export:VERB",
        "import": "auvnn.cli.import:VERB",
        "adapt": "auvnn.cli.adapt:VERB",
        "fleet": "auvnn.cli.fleet:VERB",
        "demo": "auvnn.cli.demo:VERB",
        "app": "auvnn.cli.app:VERB",
        "study": "auvnn.cli.study:VERB",
        "benchmark": "auvnn.cli.benchmark:VERB",
    },
    "auvnn.verbs",
)
