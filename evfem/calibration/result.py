"""Result of a fit: parameter values with confidence intervals, goodness of fit, unidentified parameters."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from evfem.calibration.parameters import Parameter, number_at
from evfem.common.arrays import Floats
from evfem.common.checks import real
from evfem.common.storage import check_ending, write_text
from evfem.common.tables import frame
from evfem.common.views import table
from evfem.errors import InputError, describe_value
from evfem.scene.file import loads
from evfem.scene.scene import Scene

FORMAT = "evfem-fit-1"
ARRAYS = ("unknowns", "errors", "correlation", "singular_values", "measured", "predicted", "scale")
PLAIN = ("values", "names", "warnings", "tables", "provenance")


@dataclass(frozen=True, eq=False)
class FitResult:
    """P parameters fitted to N measured numbers.

    `values` by key; `errors` (P,): standard errors of the `unknowns` (P,) of `evfem.calibration.parameters`;
    `correlation` (P, P); `singular_values` (P,) of the Jacobian with columns of unit length. `names`,
    `measured`, `predicted` and `scale` (N,): the outputs, their measured values, those of the fitted scene,
    and the sd or size by which residuals are divided. `warnings` has a sentence for each parameter or
    combination that the data do not determine.
    """

    parameters: dict[str, Parameter]
    values: dict[str, float]
    unknowns: Floats
    errors: Floats
    correlation: Floats
    singular_values: Floats
    names: list[str]
    measured: Floats
    predicted: Floats
    scale: Floats
    warnings: tuple[str, ...]
    tables: dict[str, Any]
    paths: Path
    provenance: dict[str, Any]

    def __getitem__(self, key: str) -> float:
        """The value of a parameter."""
        if key not in self.values:
            raise InputError("parameter", describe_value(key), ", ".join(self.values))
        return self.values[key]

    @property
    def residuals(self) -> Floats:
        """(predicted - measured) / scale, (N,)."""
        return (self.predicted - self.measured) / self.scale

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation of the number that the fitted scene has under each key, to first order; inf of
        what the data do not determine. `ev.uncertainty(fit.scene, fit.sd, correlation=fit.correlation)` is
        then that of a run.
        """
        rows = zip(self.parameters.items(), self.unknowns.tolist(), self.errors.tolist(), strict=True)
        return {key: abs(one.slope(z, number_at(self.tables, key))) * error for (key, one), z, error in rows}

    @property
    def covariance(self) -> Floats:
        """Covariance (P, P) of these numbers; inf and nan of what the data do not determine."""
        sd = np.array([*self.sd.values()])
        return np.asarray(self.correlation * np.outer(sd, sd))

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in sd or relative to that of the measured values."""
        return math.sqrt(float(np.mean(self.residuals**2)))

    @property
    def scene(self) -> Scene:
        """The scene with the fitted parameters, and its own output: `ev.simulate(found.scene)` is the run of
        the fit with its fields and probes, which a fit does not keep.
        """
        return loads(tomli_w.dumps(self.tables), self.paths, str(self.provenance.get("fit", "fit")))

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Ends of each parameter's interval with that confidence (0 to 1) by Student's distribution."""
        from scipy.stats import t

        confidence = real("confidence", confidence, "a number between 0 and 1", lambda c: 0.0 < c < 1.0)
        reach = t.ppf(0.5 * (1.0 + confidence), len(self.measured) - len(self.values)) * self.errors
        ends = zip(self.parameters.items(), self.unknowns - reach, self.unknowns + reach, strict=True)
        return {key: (float(one.value(low)), float(one.value(high))) for (key, one), low, high in ends}

    def table(self) -> Any:
        """A row for each parameter: value, 95 % interval, bounds, `apply`; a DataFrame or record array."""
        ends, free = list(self.intervals().values()), self.parameters.values()
        return frame(
            {
                "parameter": list(self.parameters),
                "value": list(self.values.values()),
                "lowest": [low for low, _ in ends],
                "highest": [high for _, high in ends],
                "low": [one.low for one in free],
                "high": [one.high for one in free],
                "apply": [one.apply for one in free],
            }
        )

    def __repr__(self) -> str:
        """Values with intervals, rms residual, and warnings."""
        rows = [f"  {key} = {text}" for key, text in self._rows]
        rows += [f"  Warning: {warning}" for warning in self.warnings]
        return "\n".join([f"FitResult of {self._title}", *rows])

    def _repr_html_(self) -> str:
        """For notebooks: the same as a small table."""
        warnings = [("warning", warning) for warning in self.warnings]
        return table(f"Fit of {self._title}", [*self._rows, *warnings])

    @property
    def _title(self) -> str:
        count, values = len(self.values), len(self.measured)
        size = f"{self.rms:.3g} sd" if self.provenance.get("sd") else f"{100.0 * self.rms:.3g} %"
        return f"{count} parameter{'s' * (count > 1)} to {values} values, rms residual {size}"

    @property
    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for (key, one), (low, high) in zip(self.parameters.items(), self.intervals().values(), strict=True):
            kind = "" if one.apply == "value" else f" as {one.apply}"
            told = f"{low:.3g} to {high:.3g} with 95 % confidence"
            known = told if math.isfinite(high) else "not determined"
            rows.append((key, f"{self.values[key]:.4g}{kind} ({known})"))
        return rows

    def save(self, path: str | Path) -> None:
        """Write one JSON file, in one step. Raises StorageError, and InputError for another ending."""
        check_ending(path, ".json")
        content: dict[str, Any] = {"format": FORMAT}
        content |= {name: getattr(self, name) for name in PLAIN}
        for name in ARRAYS:  # None where a number is not finite
            array: Any = np.array(getattr(self, name), dtype=object)
            array[~np.isfinite(getattr(self, name))] = None
            content[name] = array.tolist()
        content["parameters"] = {key: vars(one) for key, one in self.parameters.items()}
        content["paths"] = str(self.paths)
        write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def load(path: str | Path) -> FitResult:
    """Read what `FitResult.save` wrote. Raises InputError for any other or damaged file."""
    allowed = "a file written by FitResult.save"
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content.pop("format") != FORMAT:
            raise ValueError("another format")
        arrays: dict[str, Any] = {name: np.array(content.pop(name), dtype=float) for name in ARRAYS}
        arrays["errors"][np.isnan(arrays["errors"])] = np.inf
        parameters = {key: Parameter(**one) for key, one in content.pop("parameters").items()}
        warnings, paths = tuple(content.pop("warnings")), Path(content.pop("paths"))
        found = FitResult(parameters=parameters, warnings=warnings, paths=paths, **arrays, **content)
        with np.errstate(all="ignore"):
            repr(found)  # whose parts fit together then
        return found
    except OSError as error:
        raise InputError("fit", f"{path} ({error.strerror})", allowed) from error
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError("fit", f"{path}, damaged or of another kind: {error}", allowed) from error
