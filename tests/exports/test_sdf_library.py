"""SDF files as the format's own library reads them, where it is installed (libsdformat-dev): the same numbers."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from auvnn.exports import export
from tests.exports.cases import VEHICLES, model

CHECK = r"""
#include <iostream>
#include <sdf/sdf.hh>
int main(int, char **names) {
  std::cout.precision(17);
  for (++names; *names; ++names) {
    sdf::Root root;
    for (const auto &error : root.Load(*names)) std::cout << "error " << error.Message() << "\n";
    const sdf::Model *model = root.Model();
    if (!model) { std::cout << "error no model\n"; continue; }
    std::cout << "model " << model->Name() << " " << model->LinkCount() << " " << model->JointCount() << "\n";
    const auto inertial = model->LinkByName("base_link")->Inertial();
    const auto moments = inertial.MassMatrix().Moi();
    std::cout << "base " << inertial.MassMatrix().Mass() << " " << inertial.MassMatrix().IsValid();
    for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) std::cout << " " << moments(i, j);
    const auto place = inertial.Pose().Pos();
    std::cout << " " << place.X() << " " << place.Y() << " " << place.Z() << "\n";
  }
}
"""
FLIP = np.array([1.0, -1.0, -1.0])  # SDF's body axes are forward, left, up


def library() -> tuple[str, int]:
    """Return the name of the newest SDFormat that pkg-config knows, and its number; skip where there is none."""
    tools = [shutil.which(t) for t in ("pkg-config", "c++")]
    if not all(tools):
        pytest.skip("no pkg-config or no C++ compiler")
    listed = subprocess.run(["pkg-config", "--list-all"], capture_output=True, text=True).stdout
    found = sorted(int(n) for n in re.findall(r"^sdformat(\d+)\s", listed, re.MULTILINE))
    if not found:
        pytest.skip("SDFormat's library is not installed (Debian: libsdformat-dev)")
    return f"sdformat{found[-1]}", found[-1]


@pytest.mark.long
def test_the_formats_own_library_reads_what_is_exported(tmp_path: Path) -> None:
    name, number = library()
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", name], capture_output=True, text=True, check=True
    ).stdout.split()
    (tmp_path / "check.cpp").write_text(CHECK)
    build = ["c++", "-std=c++17", "check.cpp", "-o", "check", *flags, "-Wl,--allow-shlib-undefined"]
    subprocess.run(build, cwd=tmp_path, check=True)
    files = []
    for vehicle in VEHICLES:
        export(model(vehicle), "sdf", tmp_path / vehicle, name=vehicle)
        text = (tmp_path / vehicle / "model.sdf").read_text()
        if number < 14:  # 1.11 came with the fourteenth; before, added mass is copied without being looked at
            text = text.replace('version="1.11"', 'version="1.9"')
        files.append(tmp_path / f"{vehicle}.sdf")
        files[-1].write_text(text)
    told = subprocess.run([tmp_path / "check", *files], capture_output=True, text=True, check=True)
    assert "rror" not in told.stdout + told.stderr, told.stdout + told.stderr
    models = [line.split() for line in told.stdout.splitlines() if line.startswith("model ")]
    bases = [line.split() for line in told.stdout.splitlines() if line.startswith("base ")]
    assert [m[1] for m in models] == list(VEHICLES)
    for vehicle, counts, base in zip(VEHICLES, models, bases, strict=True):
        own = model(vehicle).vehicle
        actuators = len(own.thrusters) + len(own.fins)
        assert [int(n) for n in counts[2:]] == [actuators + 1, actuators]
        numbers = np.array(base[1:], dtype=float)
        assert numbers[0] == own.mass and numbers[1] == 1.0
        np.testing.assert_allclose(numbers[11:], FLIP * np.asarray(own.center_of_gravity), atol=1e-15)
        turned = np.outer(FLIP, FLIP) * np.asarray(own.inertia)
        np.testing.assert_allclose(numbers[2:11].reshape(3, 3), turned, rtol=1e-12)
