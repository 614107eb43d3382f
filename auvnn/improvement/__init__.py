"""Adding what is missing, and what that changes on data held out.

`improve` walks the whole loop: check, compare, diagnose, add what pays, learn the rest, and the error budget. `add`
refits with effects and compares before and after, `gains` says by how much free running improves and how sure that is,
`fleet` fits the same effects over many dives, `trend` asks whether a parameter changes from dive to dive.
"""

from auvnn.improvement.add import add
from auvnn.improvement.added import Improvement
from auvnn.improvement.answer import Improved, Step
from auvnn.improvement.fleet import Fleet, fleet
from auvnn.improvement.loop import improve

__all__ = ["Fleet", "Improved", "Improvement", "Step", "add", "fleet", "improve"]
