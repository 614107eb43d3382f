"""Adding what is missing, and what that changes on data held out.

`add` refits with effects and compares before and after, `gains` says by how much free running improves and how
sure that is, `fleet` fits the same effects over many dives, `trend` asks whether a parameter changes from dive to
dive.
"""

from auvnn.improvement.add import Improvement, add
from auvnn.improvement.fleet import Fleet, fleet

__all__ = ["Fleet", "Improvement", "add", "fleet"]
