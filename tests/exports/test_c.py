"""C99: compiled without a warning, and equal to the model at a thousand random states."""

from __future__ import annotations

import ctypes
import re
import subprocess
import time

import numpy as np
import pytest
import torch

from auvnn.compiled import toolchain
from auvnn.exports import export
from auvnn.exports.system import System
from auvnn.models import Inputs
from tests.exports.cases import OTHERS, VEHICLES, differs, model

STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
NUMBER = {"double": ctypes.c_double, "float": ctypes.c_float}


@pytest.fixture(scope="module")
def cc():
    found = toolchain.compiler()
    if found is None:
        pytest.skip("no C compiler")
    return found


def compiled(cc, folder, name, *flags):
    subprocess.run(
        [cc, *STRICT, *flags, "-fPIC", "-shared", "-o", "lib.so", f"{name}.c", "-lm"], cwd=folder, check=True
    )
    return ctypes.CDLL(str(folder / "lib.so"))


def called(library, name, precision, arguments, size):
    """Return what a function leaves in one array, for each row of arguments."""
    kind = NUMBER[precision]
    function = getattr(library, name)
    rows = len(arguments[0])
    dtype = np.dtype(kind)
    given = [np.ascontiguousarray(a, dtype=dtype).reshape(rows, -1) for a in arguments]
    out = np.zeros((rows, size), dtype=dtype)
    for k in range(rows):
        # Numbers that stand alone go by value, arrays by address.
        words = [
            kind(g[k, 0]) if a.ndim == 1 else ctypes.c_void_p(g[k].ctypes.data)
            for a, g in zip(arguments, given, strict=True)
        ]
        function(*words, ctypes.c_void_p(out[k].ctypes.data))
    return out


@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", [*VEHICLES, *OTHERS])
def test_the_code_is_the_model(cc, tmp_path, name, precision):
    if precision == "float" and name not in ("bluerov2_heavy", "everything", "actuators"):
        pytest.skip("single precision is measured on three models")
    own = model(name)
    out = export(own, "c", tmp_path / "c", precision=precision)
    assert out.lost == ()
    system = System(own, 0.05)
    library = compiled(cc, tmp_path / "c", system.name, "-O0")
    a = system.samples(1000, seed=21)
    with torch.no_grad():
        rate = system.flow.rate(a["x"], a["u"], a["t"])
        after = system.steps.step(a["s"], a["u"], a["t"], a["h"])
    n = {k: v.numpy() for k, v in a.items()}
    tolerance = {"double": 1e-12, "float": 1e-5}[precision]
    found = called(library, f"{system.name}_rate", precision, [n["t"], n["x"], n["u"]], system.flow.size)
    assert differs(found, rate) < tolerance
    found = called(
        library, f"{system.name}_step", precision, [n["t"], n["h"], n["s"], n["u"]], system.steps.size
    )
    assert differs(found, after) < tolerance


def test_the_slopes_are_those_of_the_model(cc, tmp_path):
    own = model("everything")
    export(own, "c", tmp_path / "c")
    system = System(own, 0.05)
    library = compiled(cc, tmp_path / "c", system.name, "-O0")
    a = system.samples(50, seed=3)
    size, m = system.flow.size, system.flow.inputs
    function, both = getattr(library, f"{system.name}_jacobian"), []
    for t, x, u in zip(*(a[k].numpy() for k in ("t", "x", "u")), strict=True):
        left, right = np.zeros(size * size), np.zeros(size * m)
        function(ctypes.c_double(t), *(ctypes.c_void_p(v.ctypes.data) for v in (x, u, left, right)))
        both.append(np.concatenate([left.reshape(size, size), right.reshape(size, m)], axis=1))
    inputs = system.flow.split(a["u"])
    extra = {"fins": inputs.fins, "voltage": inputs.voltage, "altitude": inputs.altitude}
    slopes = own.linearise(a["x"], inputs.command, time=a["t"], **extra)
    expected = torch.cat([slopes.A, slopes.B], dim=-1).numpy()
    assert np.abs(np.array(both) - expected).max() < 1e-10 * np.abs(expected).max()


def test_its_own_test_program_passes_and_notices(cc, tmp_path):
    export(model("actuators"), "c", tmp_path / "c", name="pipe")
    run = [cc, *STRICT, "-O1", "pipe_test.c", "pipe.c", "-lm", "-o", "pipe_test"]
    subprocess.run(run, cwd=tmp_path / "c", check=True)
    done = subprocess.run(["./pipe_test"], cwd=tmp_path / "c", capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "pipe: all agree\n")
    text = (tmp_path / "c" / "pipe.c").read_text()
    assert "malloc" not in text
    # A step of another length than that for which the delay is kept is refused.
    library = compiled(cc, tmp_path / "c", "pipe", "-O0")
    state = np.zeros(200)
    words = [ctypes.c_double(0.0), ctypes.c_double(0.04), *[ctypes.c_void_p(state.ctypes.data)] * 3]
    assert library.pipe_step(*words) == 1 and not state.any()
    (tmp_path / "c" / "pipe.c").write_text(text.replace("rate[12] = ", "rate[12] = 1.001 * "))
    subprocess.run(run, cwd=tmp_path / "c", check=True)
    assert subprocess.run(["./pipe_test"], cwd=tmp_path / "c", capture_output=True).returncode == 1


def test_the_example_of_the_page_runs(cc, tmp_path):
    from auvnn.docs import page

    export(model("rov95"), "c", tmp_path / "c")
    [example] = re.findall(r"^```c\n(.*?)^```", page("exports"), re.MULTILINE | re.DOTALL)
    (tmp_path / "c" / "example.c").write_text(example)
    build = [cc, *STRICT, "-O1", "example.c", "rov95.c", "-lm", "-o", "example"]
    subprocess.run(build, cwd=tmp_path / "c", check=True)
    done = subprocess.run(["./example"], cwd=tmp_path / "c", capture_output=True, text=True, check=True)
    assert re.fullmatch(r"[\d.]+ m north, d u_dot / d u = -[\d.]+ 1/s\n", done.stdout)


def test_settled_actuators_are_where_they_stay(cc, tmp_path):
    own = model("actuators")
    export(own, "c", tmp_path / "c", name="pipe")
    library = compiled(cc, tmp_path / "c", "pipe", "-O0")
    system = System(own, 0.05)
    a = system.samples(5, seed=8)
    for u in a["u"].numpy():
        x, s = np.zeros(system.flow.size), np.zeros(system.steps.size)
        x[3] = s[3] = 1.0
        rate, after = np.zeros_like(x), np.zeros_like(s)
        at = [ctypes.c_void_p(v.ctypes.data) for v in (u, x, s, rate, after)]
        library.pipe_settle(at[0], at[1])
        library.pipe_settle_step(at[0], at[2])
        library.pipe_rate(ctypes.c_double(0.0), at[1], at[0], at[3])
        library.pipe_step(ctypes.c_double(0.0), ctypes.c_double(0.05), at[2], at[0], at[4])
        assert np.abs(rate[13:]).max() < 1e-9
        assert np.abs(after[13:] - s[13:]).max() < 1e-12
        assert np.abs(s[13:]).max() > 1


@pytest.mark.long
@pytest.mark.parametrize("name", ["rov95", "bluerov2_heavy", "networks"])
def test_a_step_is_no_slower_than_the_compiled_engine(cc, tmp_path, name):
    own = model(name)
    export(own, "c", tmp_path / "c", name="fast")
    (tmp_path / "c" / "loop.c").write_text(
        '#include "fast.h"\n'
        "void loop(long n, fast_real *s, const fast_real *u);\n"
        "void loop(long n, fast_real *s, const fast_real *u)\n"
        "{ for (long k = 0; k < n; k++) fast_step(0.05 * (double)k, 0.05, s, u, s); }\n"
    )
    # By the same compiler with the same flags.
    build = [cc, *toolchain.FLAGS, "-o", "lib.so", "fast.c", "loop.c", "-lm"]
    subprocess.run(build, cwd=tmp_path / "c", check=True)
    library = ctypes.CDLL(str(tmp_path / "c" / "lib.so"))
    rows, system = 40_001, System(own, 0.05)
    state = np.zeros(system.steps.size)
    state[2], state[3] = 10.0, 1.0
    u = np.full(system.flow.inputs, 0.1)
    mine, theirs = [], []
    times = 0.05 * torch.arange(rows, dtype=torch.float64)
    inputs = Inputs(torch.full((rows, own.actuators.size), 0.1, dtype=torch.float64))
    eta = torch.tensor(state[:7])
    with torch.no_grad():
        for _ in range(7):  # by the processor's time: what else the machine does is not counted
            begin = time.process_time()
            library.loop(
                ctypes.c_long(rows - 1), *(ctypes.c_void_p(v.ctypes.data) for v in (state.copy(), u))
            )
            mine.append(time.process_time() - begin)
            begin = time.process_time()
            own.rollout(
                eta, torch.zeros(6, dtype=torch.float64), inputs, times, engine="compiled", check=False
            )
            theirs.append(time.process_time() - begin)
    print(f"{name}: {1e6 * min(mine) / rows:.2f} us a step, the engine {1e6 * min(theirs) / rows:.2f}")
    assert min(mine) <= min(theirs)
