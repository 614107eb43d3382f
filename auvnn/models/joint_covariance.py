"""How uncertain the parameters of fitted effects are together: their covariance, as a fit left it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ModelError

Array = NDArray[np.float64]
# Share of the largest eigenvalue, or of the standard deviations' product, that passes for rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class JointCovariance:
    """The covariance of parameters of effects, SI units.

    Attributes:
        parameters: "effect.parameter", k of them.
        matrix: (k, k), symmetric and positive semi-definite.
    """

    parameters: tuple[str, ...]
    matrix: Array

    @classmethod
    def read(cls, given: Any, known: Collection[str], where: str) -> JointCovariance:
        """Return what a model file says.

        Args:
            given: its entry: `parameters` and `matrix`.
            known: "effect.parameter" of the model's effects.
            where: the file, for messages.

        Raises:
            ModelError: it is no covariance of parameters that the model has.
        """
        again = "save the model again"
        if not isinstance(given, Mapping) or set(given) != {"parameters", "matrix"}:
            raise ModelError(
                f"{where}: covariance needs 'parameters' and 'matrix', and nothing else: {again}"
            )
        names = given["parameters"]
        if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
            raise ModelError(f"{where}: covariance.parameters is no list of names: {again}")
        if strange := [n for n in names if n not in known]:
            raise ModelError(
                f"{where}: covariance names {strange[0]}, which is no parameter of the model's effects: {again}"
            )
        if len(set(names)) < len(names):
            raise ModelError(f"{where}: covariance names a parameter twice: {again}")
        try:
            matrix = np.array(given["matrix"], dtype=np.float64)
        except (TypeError, ValueError):
            raise ModelError(f"{where}: covariance.matrix is no matrix of numbers: {again}") from None
        size = (len(names), len(names))
        if matrix.shape != size:
            raise ModelError(f"{where}: covariance.matrix is {matrix.shape}, not {size}: {again}")
        if not np.isfinite(matrix).all():
            raise ModelError(f"{where}: covariance.matrix holds NaN or infinity: {again}")
        std = np.sqrt(np.maximum(np.diag(matrix), 0.0))
        if (np.abs(matrix - matrix.T) > ROUNDING * np.outer(std, std)).any():
            raise ModelError(f"{where}: covariance.matrix is not symmetric: {again}")
        # In units of the standard deviations: parameters have different units, and a large one would hide others.
        unit = np.where(std > 0.0, std, 1.0)
        even = matrix / np.outer(unit, unit)
        if (np.diag(matrix) < 0.0).any() or (
            len(names) and np.linalg.eigvalsh(even)[0] < -ROUNDING * len(names)
        ):
            raise ModelError(f"{where}: covariance.matrix is not positive semi-definite: {again}")
        return cls(tuple(names), matrix)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of a model file."""
        return {"parameters": list(self.parameters), "matrix": self.matrix.tolist()}

    def of(self, effects: Collection[str]) -> JointCovariance | None:
        """Return the part that concerns some effects; None where nothing is left of it."""
        keep = [k for k, name in enumerate(self.parameters) if name.partition(".")[0] in effects]
        if not keep:
            return None
        return JointCovariance(tuple(self.parameters[k] for k in keep), self.matrix[np.ix_(keep, keep)])

    def correlation(self, parameters: Sequence[str]) -> Array:
        """Return the correlations of some parameters, (p, p); those that are not known of are independent."""
        at = {name: k for k, name in enumerate(self.parameters)}
        out = np.eye(len(parameters))
        known = [k for k, name in enumerate(parameters) if name in at]
        index = [at[parameters[k]] for k in known]
        std = np.sqrt(np.diag(self.matrix)[index])
        unit = np.where(std > 0.0, std, np.inf)
        part = self.matrix[np.ix_(index, index)] / np.outer(unit, unit)
        np.fill_diagonal(part, 1.0)
        out[np.ix_(known, known)] = part
        return out
