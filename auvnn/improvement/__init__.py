"""Adding what is missing, and what that changes on data held out.

`add` refits with effects (`fits`), compares before and after (`held_out`, `gains`) and answers with what was `added`;
`free_run` is its fit by free running. `loop` runs the whole loop automatically: check, compare, diagnose, add what pays,
learn the rest. `fleet` fits the same effects over many dives, each by `one_dive`, and `trend` asks whether a
parameter changes from dive to dive.
"""

from auvnn.improvement.add import add
from auvnn.improvement.added import Improvement
from auvnn.improvement.fleet import Fleet, fleet
from auvnn.improvement.loop.answer import Improved, Step
from auvnn.improvement.loop.improve import improve

__all__ = ["Fleet", "Improved", "Improvement", "Step", "add", "fleet", "improve"]
