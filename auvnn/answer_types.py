"""The entries of JSON answers as type checkers see them; when the program runs they are plain dictionaries.

Whoever indexes an answer (`found.candidates[0]["parameters"]`) finds here which keys there are. Units are SI.
"""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict


class ParameterValue(TypedDict):
    """A fitted parameter: its value, the standard error (NaN where there is none), and the unit of both."""

    value: float
    std: float
    unit: str


Parameters = dict[str, ParameterValue]
"""An effect's parameters by name."""

ByEffect = dict[str, Parameters]
"""Effects by name, each with its parameters."""


class DerivativeEntry(TypedDict):
    """How accelerations were obtained; figures are comparable only at equal bandwidth, Hz."""

    method: str
    bandwidth_hz: float | None


class SearchStep(TypedDict):
    """What a diagnosis found in one step, or what stopped it."""

    verdict: str
    effects: list[str]
    p_value: float


class Similar(TypedDict):
    """An effect that leaves a similar trace on the log: 1 means that the log cannot tell them apart."""

    effect: str
    similarity: float


class Candidate(TypedDict):
    """What a diagnosis says about one effect of the catalogue; None where the log or the fit says nothing."""

    effect: str
    p_value: float | None
    explained: float | None
    cv_before: float | None
    cv_after: float | None
    parameters: Parameters
    confusable_with: list[Similar]
    needs: list[str]
    reason: str | None


class MovedCoefficient(TypedDict):
    """A stated coefficient that a fit has moved, as a factor on what was stated, in stated standard deviations."""

    group: str
    coefficient: str
    stated: float
    fitted: float
    deviations: float


class Failure(TypedDict):
    """Where the error of a model sits: degree of freedom, place in plain words, share of the residual's energy."""

    channel: str
    where: str
    share: float


class Fall(TypedDict):
    """The fall of an error, and its standard error."""

    value: float
    std: float


class RefittedCoefficients(TypedDict):
    """What refitting the stated coefficients brings on what was left out: errors of free running over a horizon, s."""

    before: float
    after: float
    horizon: float
    gain: Fall
    coefficients: list[MovedCoefficient]
    command: str


class OwnFall(TypedDict):
    """What one effect adds to the others on held-out data."""

    gain: Fall
    accepted: bool
    reservations: list[str]


class Worst(TypedDict):
    """The velocity whose error rises most without an effect, and by what share."""

    velocity: str
    cost: float


class EffectCost(TypedDict):
    """Whether an effect matters: what the free-running error costs without it, and how large its force is."""

    cost: float | None
    worst: Worst | None
    force: dict[str, float]
    share: float | None
    gain: Fall | None
    matters: bool


class NextExperiment(TypedDict):
    """The manoeuvre that would separate candidates, and by how many standard errors each manoeuvre would."""

    words: str
    manoeuvre: str
    separates: list[str]
    standard_errors: float
    ranking: list[dict[str, str | float]]


class SearchedPart(TypedDict):
    """The part of a long log on which a search ran; seconds."""

    windows: int
    stretches: int
    seconds: float
    words: str


class Dive(TypedDict):
    """One dive of a fleet: its file, when it began and from what that is known, its length in s, its values, its place.

    `dive` is its number in the order of the dates or of the names, from 1; `days` since the first one; `commands` as a
    model file states it, None where they are held between samples or the dive does not tell.
    """

    file: str
    start: str | None
    start_from: str | None
    seconds: float
    samples: int
    windows: int
    verdict: str
    cv: float
    settled: bool
    commands: dict[str, Any] | None
    parameters: ByEffect
    coefficients: ByEffect
    dive: int
    days: float | None


class Mean(TypedDict):
    """A weighted mean and its standard error."""

    value: float
    std: float


class Constancy(TypedDict):
    """The test that a parameter is the same on all dives."""

    chi2: float
    degrees: int
    p_value: float


class Slope(TypedDict):
    """The slope of a parameter over days or dives, with the test that it is zero."""

    value: float
    std: float
    unit: str
    p_value: float


class ParameterTrend(TypedDict):
    """How a parameter goes from dive to dive."""

    effect: str
    parameter: str
    unit: str
    dives: int
    mean: Mean
    constancy: Constancy
    slope: Slope
    line: dict[str, float]
    scatter: float
    changes: bool
    words: str


class SkippedSamples(TypedDict):
    """How many samples an adapter did not learn from for one reason, and the reason in words."""

    count: int
    words: str


class ChangeKind(TypedDict):
    """What one kind of change would explain: logarithm of the odds against no change, and the share of the residual."""

    kind: str
    evidence: float
    explained: float


class ChangeEntry(TypedDict):
    """A change of the vehicle that an adaptation saw; times in s, see `auvnn.online` for the kinds."""

    run: int
    time: float
    detected: float
    kind: str
    effect: str | None
    parameters: Parameters
    evidence: float
    explained: float
    kinds: list[ChangeKind]
    words: str


class AdaptationHistory(TypedDict):
    """A run's adaptation over time: six errors of acceleration for each stretch, how far weights moved, and why not."""

    run: int
    t: list[float]
    prediction_error: list[list[float | None]]
    unadapted_error: list[list[float | None]]
    moved: list[float]
    cause: list[str]


class FrozenErrors(TypedDict):
    """A run's errors of free running with the weights of each moment, and with those at the start; diverged of both."""

    run: int
    horizon: float
    t: list[float]
    adapted: list[list[float]]
    unadapted: list[list[float]]
    diverged: NotRequired[list[int]]


class WaterfallStep(TypedDict):
    """The held-out error after a step, the last one that of noise alone; `kind` and `left_out` in the whole loop only.

    `left_out` is the step's error on what was left out of the log that was fitted; None where it was not judged so.
    """

    step: str
    error: float
    kind: NotRequired[str]
    left_out: NotRequired[float | None]
