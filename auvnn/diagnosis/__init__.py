"""Which physical effect is missing? Hypotheses are tested, fitted, compared and accepted, and what they leave is tested.

`diagnose` prepares model and log (`hypotheses`). `search` goes in rounds (`stages`) from the fit of the null through
`score_tests` and `selection` to tests of the `residuals`, until nothing more is accepted; where a force is left without a
name, `noise_law` estimates it and compares the names again. `answers` states the result, with costs by
`cross_validation`, and `advise` says what to drive next. `one_step` ranks the catalogue by accelerations instead, and
`full_data` serves logs larger than memory.
"""

from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.full_data.large_logs import diagnose_files
from auvnn.diagnosis.one_step.rank import Ranked, rank_one_step

__all__ = ["Diagnosis", "Ranked", "diagnose", "diagnose_files", "rank_one_step"]
