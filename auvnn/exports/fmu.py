"""FMI 3.0: one file for co-simulation and model exchange, with its C sources and this machine's binary."""

from __future__ import annotations

import hashlib
import platform
import subprocess
import tempfile
import zipfile
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree as xml

from auvnn.compiled import toolchain
from auvnn.exports.base import Target, Written
from auvnn.exports.c import header, source
from auvnn.exports.check import agreement
from auvnn.exports.origin import ORIGIN
from auvnn.exports.system import System
from auvnn.models.actuation.actuator_states import PADE
from auvnn.models.free_running.rate import SIZE

UNITS = {
    "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "rad/s": {"rad": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2}, "rad": {"rad": 1}, "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "s": {"s": 1},
}  # fmt: skip


class FmuTarget(Target):
    """NAME.fmu: no Python at the target, no library but the C one."""

    name = "fmu"
    summary = "FMI 3.0 FMU with sources: co-simulation, and model exchange where nothing is delayed"

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write NAME.fmu."""
        code = {f"{system.name}.h": header(system, precision), f"{system.name}.c": source(system, precision)}
        digest = hashlib.sha256("".join(code.values()).encode()).hexdigest()
        token = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
        code["fmu.c"] = _settings(system, token) + files("auvnn.exports").joinpath("fmu_wrapper.c").read_text(
            "utf-8"
        )
        written = Written(system.lost(), system.notes(), agreement(system))
        parts: dict[str, bytes] = {"modelDescription.xml": description(system, token)}
        parts |= {f"sources/{name}": text.encode() for name, text in code.items()}
        parts["sources/buildDescription.xml"] = _build(system)
        binary, words = _binary(system.name, code)
        if binary is not None:
            parts[binary[0]] = binary[1]
        written.notes.append(words)
        if system.delay:
            written.notes.append(
                f"for co-simulation alone; communication steps are whole multiples of {system.dt:g} s"
            )
        with zipfile.ZipFile(folder / f"{system.name}.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in parts.items():
                # The same model gives the same file, whenever it is written.
                archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
        return written


def _shown(system: System) -> int:
    """Return how many states are variables of the FMU: what is in the pipe of a delay is not."""
    return system.flow.size - (PADE * system.flow.actuators.size if system.delay else 0)


def _settings(system: System, token: str) -> str:
    """Return what the wrapper needs to know."""
    shown, rates = _shown(system), 0 if system.delay else _shown(system)
    start = ", ".join(f"{v!r}" for v in _start(system))
    inputs = ", ".join(f"{v!r}" for v in _start_inputs(system))
    return f"""/* Written by {ORIGIN}. */
#include "{system.name}.h"

#define MODEL(name) {system.name}_##name
#define TOKEN "{token}"
#define STATES {system.flow.size}
#define STEP_STATES {system.steps.size}
#define INPUTS {system.flow.inputs}
#define SHOWN {shown}
#define MOVABLE {SIZE}
#define FIRST_INPUT {1 + shown + rates}
#define STEP {system.dt!r}
#define DELAYED {int(bool(system.delay))}
static const double START[] = {{{start}}};
static const double START_INPUTS[] = {{{inputs}}};

"""


def _start(system: System) -> list[float]:
    """Return where the vehicle starts: at rest, level, at a depth of 10 m."""
    return [0.0, 0.0, 10.0, 1.0, *(0.0,) * 9]


def _start_inputs(system: System) -> list[float]:
    given = {"voltage": float(system.model.vehicle.reference_voltage or 16.0), "altitude": 10.0}
    return [given.get(name, 0.0) for name in system.flow.input_names()]


def description(system: System, token: str) -> bytes:
    """Return modelDescription.xml."""
    name, delayed = system.name, bool(system.delay)
    root = xml.Element("fmiModelDescription", {
        "fmiVersion": "3.0", "modelName": system.model.vehicle.name, "instantiationToken": token,
        "description": "Equations of motion of an underwater vehicle (NED, body x forward, y starboard, z down)",
        "generationTool": f"{ORIGIN}", "variableNamingConvention": "structured",
    })  # fmt: skip
    common = {"modelIdentifier": name, "canGetAndSetFMUState": "true"}
    if not delayed:
        xml.SubElement(root, "ModelExchange", common)
    step = (
        {"fixedInternalStepSize": repr(system.dt)}
        if delayed
        else {"canHandleVariableCommunicationStepSize": "true"}
    )
    xml.SubElement(root, "CoSimulation", {**common, **step})
    units = xml.SubElement(root, "UnitDefinitions")
    for unit, base in UNITS.items():
        xml.SubElement(
            xml.SubElement(units, "Unit", {"name": unit}), "BaseUnit", {k: str(v) for k, v in base.items()}
        )
    xml.SubElement(
        root, "DefaultExperiment", {"startTime": "0", "stopTime": "10", "stepSize": repr(system.dt)}
    )
    variables, structure = xml.SubElement(root, "ModelVariables"), xml.Element("ModelStructure")

    def variable(reference: int, label: str, unit: str | None, **more: str) -> None:
        given = {"name": label, "valueReference": str(reference), **more} | ({"unit": unit} if unit else {})
        xml.SubElement(variables, "Float64", given)

    variable(0, "time", "s", causality="independent", variability="continuous")
    names, shown = system.flow.state_names()[: _shown(system)], _shown(system)
    start = _start(system)
    for k, label in enumerate(names):
        how = {"initial": "exact", "start": repr(start[k])} if k < SIZE else {"initial": "calculated"}
        variable(1 + k, label, _unit(label), causality="output", variability="continuous", **how)
        xml.SubElement(structure, "Output", {"valueReference": str(1 + k)})
    if not delayed:
        for k, label in enumerate(names):
            variable(1 + shown + k, f"der({label})", None, causality="local", variability="continuous",
                     initial="calculated", derivative=str(1 + k))  # fmt: skip
            xml.SubElement(structure, "ContinuousStateDerivative", {"valueReference": str(1 + shown + k)})
    for k in range(SIZE, shown):
        xml.SubElement(structure, "InitialUnknown", {"valueReference": str(1 + k)})
    for k in range(0 if delayed else shown):
        xml.SubElement(structure, "InitialUnknown", {"valueReference": str(1 + shown + k)})
    first = 1 + shown * (1 if delayed else 2)
    for k, (label, value) in enumerate(zip(system.flow.input_names(), _start_inputs(system), strict=True)):
        variable(
            first + k, label, _unit(label), causality="input", variability="continuous", start=repr(value)
        )
    root.append(structure)
    xml.indent(root)
    return xml.tostring(root, encoding="utf-8", xml_declaration=True)


def _unit(name: str) -> str | None:
    """Return the unit of a state or an input, None for a pure number."""
    if name in ("x", "y", "z", "altitude"):
        return "m"
    if name in ("u", "v", "w"):
        return "m/s"
    if name in ("p", "q", "r"):
        return "rad/s"
    if name.startswith("fin_"):
        return "rad"
    if name == "voltage":
        return "V"
    if name.startswith("thrust.") or name.startswith("tau_"):
        return "N.m" if name[-1] in "KMN" else "N"
    return None


def _build(system: System) -> bytes:
    """Return sources/buildDescription.xml."""
    root = xml.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    made = xml.SubElement(root, "BuildConfiguration", {"modelIdentifier": system.name})
    group = xml.SubElement(made, "SourceFileSet", {"language": "C99"})
    for name in (f"{system.name}.c", "fmu.c"):
        xml.SubElement(group, "SourceFile", {"name": name})
    xml.indent(root)
    return xml.tostring(root, encoding="utf-8", xml_declaration=True)


def _binary(name: str, code: dict[str, str]) -> tuple[tuple[str, bytes] | None, str]:
    """Return the place and the content of this machine's binary, or None, and what to say about it."""
    command = toolchain.compiler()
    if command is None:
        return None, "no C compiler here: the FMU holds sources alone, for importers that compile them"
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    system, ending = {"Darwin": ("darwin", "dylib")}.get(platform.system(), ("linux", "so"))
    with tempfile.TemporaryDirectory() as folder:
        for file, text in code.items():
            Path(folder, file).write_text(text, encoding="utf-8")
        out = Path(folder, f"{name}.{ending}")
        flags = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"]
        sources = [f"{name}.c", "fmu.c"]
        try:
            done = subprocess.run(
                [command, *flags, "-o", str(out), *sources, "-lm"], cwd=folder, capture_output=True, text=True,
                timeout=toolchain.TIMEOUT, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as problem:
            return None, f"the compiler failed ({type(problem).__name__}): the FMU holds sources alone"
        if done.returncode:
            first = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
            return None, f"the compiler failed ({first.strip()[:120]}): the FMU holds sources alone"
        tuple_ = f"{machine}-{system}"
        return (
            f"binaries/{tuple_}/{name}.{ending}",
            out.read_bytes(),
        ), f"holds the sources and a binary for {tuple_}"
