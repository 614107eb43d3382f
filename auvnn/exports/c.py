"""C99 for firmware and simulators: state derivative, its Jacobian, one step, and a program that tests them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from auvnn.answers import write_text
from auvnn.exports.base import Target, Written
from auvnn.exports.c_code import Dialect, block, grouped
from auvnn.exports.check import agreement
from auvnn.exports.origin import ORIGIN
from auvnn.exports.system import System
from auvnn.models.free_running.rate import SIZE

CASES = 12
TOLERANCE = {"double": 1e-11, "float": 1e-4}


class CTarget(Target):
    """C99 without malloc and without global state; only math.h is needed."""

    name = "c"
    summary = "C99: state derivative, Jacobian, one RK4 step, and a test program"
    precisions = ("double", "float")

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write NAME.h, NAME.c and NAME_test.c."""
        name = system.name
        write_text(folder / f"{name}.h", header(system, precision))
        write_text(folder / f"{name}.c", source(system, precision))
        write_text(folder / f"{name}_test.c", tests(system, precision))
        operations = (
            f"{system.rate.operations} operations a derivative, {system.jacobian.operations} a Jacobian"
        )
        build = f"cc -std=c99 -O2 {name}_test.c {name}.c -lm -o {name}_test && ./{name}_test"
        return Written(
            system.lost(), [*system.notes(), operations, f"test it with: {build}"], agreement(system)
        )


def header(system: System, precision: str) -> str:
    """Return the header."""
    name, upper = system.name, system.name.upper()
    flow, steps = system.flow, system.steps

    def listed(names: list[str]) -> str:
        return "\n".join(f" *   {k:3d}  {n}" for k, n in enumerate(names))

    same = system.delay == 0
    delay = (
        "A step is of any length h: up to 0.05 s it is what a rollout does."
        if same
        else f"A step is of {upper}_STEP seconds: with any other h nothing is done, and 1 is returned."
    )
    other = (
        ""
        if same
        else f" *\n * State s of the steps, in which the delay is exact:\n{listed(steps.state_names())}\n"
    )
    return f"""/* {name}: equations of motion of an underwater vehicle, written by {ORIGIN}.
 *
 * SI units and radians; positions in NED, velocities in the body frame x forward, y starboard, z down;
 * the quaternion (w, x, y, z) turns body vectors into NED ones. No function allocates, and none has a separate state.
 *
 * State x in continuous time:
{listed(flow.state_names())}
{other} *
 * Inputs u (commands in [-1, 1] or N and N m, fin angles in rad, voltage in V, altitude in m):
{listed(flow.input_names())}
 */
#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern "C" {{
#endif

typedef {"float" if precision == "float" else "double"} {name}_real;

#define {upper}_STATES {flow.size}
#define {upper}_STEP_STATES {steps.size}
#define {upper}_INPUTS {flow.inputs}
#define {upper}_STEP {system.dt!r}{"f" if precision == "float" else ""}

/* Rate of the state x [{upper}_STATES] at time t under inputs u [{upper}_INPUTS]. */
void {name}_rate({name}_real t, const {name}_real *x, const {name}_real *u, {name}_real *rate);

/* Its slopes, row by row: a[i * {upper}_STATES + j] = d rate_i / d x_j, b[i * {upper}_INPUTS + j] = d rate_i / d u_j. */
void {name}_jacobian({name}_real t, const {name}_real *x, const {name}_real *u, {name}_real *a, {name}_real *b);

/* State s [{upper}_STEP_STATES] h seconds later, u held; next may be s. RK4, lag and filters of the actuators in closed
 * form. Returns 0. {delay} */
int {name}_step({name}_real t, {name}_real h, const {name}_real *s, const {name}_real *u, {name}_real *next);

/* Fill in what actuators remember (from x[13] and s[13] on) as if they had been at u for long. */
void {name}_settle(const {name}_real *u, {name}_real *x);
void {name}_settle_step(const {name}_real *u, {name}_real *s);

#ifdef __cplusplus
}}
#endif

#endif
"""


def source(system: System, precision: str) -> str:
    """Return the functions."""
    name, say = system.name, Dialect(system.name, precision == "float")
    real, n, flow = f"{name}_real", system.flow.actuators.acting, system.flow
    rate, step, settled = (g.results for g in (system.actuator_rate, system.actuator_step, system.settled))
    k, whole, risen = flow.actuators.states, system.jacobian.results, _risen(system)
    parts = [
        f'/* Written by {ORIGIN}; see {name}.h. */\n#include "{name}.h"\n\n#include <math.h>\n',
        say.helpers(_together(system)),
        say.function_of(
            f"static void {name}_motion(const {real} *y, const {real} *f, const {real} *u, {real} t, {real} *rate)",
            system.motion, {"rate": system.motion.results},
        ),
        say.function_of(
            f"static void {name}_actuate(const {real} *a, const {real} *u, {real} *thrust, {real} *rate)",
            system.actuator_rate, {"thrust": rate[:n], "rate": rate[n:]}, ("rate",),
        ),
        say.function_of(
            f"static void {name}_hold(const {real} *a, const {real} *u, {real} h, {real} *mean, {real} *rise, "
            f"{real} *next)",
            system.actuator_step, {"mean": step[:n], "rise": step[n : 2 * n] if risen else (), "next": step[2 * n :]},
            ("rise", "next"),
        ),
        say.function_of(
            f"static void {name}_unit(const {real} *y, {real} *out)", system.unit, {"out": system.unit.results}
        ),
        *(
            say.function_of(
                f"void {name}_{verb}(const {real} *u, {real} *x)", system.settled, {f"(x + {SIZE})": nodes}, ("x",)
            )
            for verb, nodes in (("settle", settled[:k]), ("settle_step", settled[k:]))
        ),
        block(
            f"void {name}_rate({real} t, const {real} *x, const {real} *u, {real} *rate)",
            [
                f"{real} thrust[{n}];",
                f"{name}_actuate(x + {SIZE}, u, thrust, rate + {SIZE});",
                f"{name}_motion(x, thrust, u, t, rate);",
            ],
        ),
        say.function_of(
            f"void {name}_jacobian({real} t, const {real} *x, const {real} *u, {real} *a, {real} *b)",
            system.jacobian, {"a": whole[: flow.size**2], "b": whole[flow.size**2 :]},
        ),
        _step(system, say, risen),
    ]  # fmt: skip
    return "\n".join(parts)


def _together(system: System) -> set[str]:
    """Return the functions that are called on many numbers at once."""
    graphs = (
        system.motion,
        system.actuator_rate,
        system.actuator_step,
        system.unit,
        system.settled,
        system.jacobian,
    )
    return {g.scalars.operation[node] for g in graphs for node in grouped(g, g.results)[1]}


def _risen(system: System) -> bool:
    """Return whether the thrust changes within a step."""
    n = system.flow.actuators.acting
    return any(
        system.actuator_step.scalars.value(node) != 0.0 for node in system.actuator_step.results[n : 2 * n]
    )


def _step(system: System, say: Dialect, risen: bool) -> str:
    """Return the step: the classical Runge-Kutta scheme around the functions above."""
    name, upper, real = system.name, system.name.upper(), f"{system.name}_real"
    n, m = system.flow.actuators.acting, system.steps.actuators.states
    half, sixth = ("0.5f", "6.0f") if say.single else ("0.5", "6.0")
    wanted = (
        [f"if ({say.function('abs')}(h - {upper}_STEP) > {say.number(1e-6)} * {upper}_STEP)", "    return 1;"]
        if system.delay
        else []
    )
    edge = [("low", "-"), ("high", "+")] if risen else []
    lines = [
        f"{real} mean[{n}], rise[{n}], after[{max(m, 1)}], at[{SIZE}], k[4][{SIZE}];",
        *(f"{real} {end}[{n}];" for end, _ in edge),
        *wanted,
        f"{name}_hold(s + {SIZE}, u, h, mean, rise, after);",
        *(f"for (int i = 0; i < {n}; i++) {end}[i] = mean[i] {sign} {half} * rise[i];" for end, sign in edge),
        f"{name}_motion(s, {'low' if risen else 'mean'}, u, t, k[0]);",
        f"for (int i = 0; i < {SIZE}; i++) at[i] = s[i] + {half} * h * k[0][i];",
        f"{name}_motion(at, mean, u, t + {half} * h, k[1]);",
        f"for (int i = 0; i < {SIZE}; i++) at[i] = s[i] + {half} * h * k[1][i];",
        f"{name}_motion(at, mean, u, t + {half} * h, k[2]);",
        f"for (int i = 0; i < {SIZE}; i++) at[i] = s[i] + h * k[2][i];",
        f"{name}_motion(at, {'high' if risen else 'mean'}, u, t + h, k[3]);",
        f"for (int i = 0; i < {SIZE}; i++)",
        f"    at[i] = s[i] + h / {sixth} * (k[0][i] + k[1][i] + k[1][i] + k[2][i] + k[2][i] + k[3][i]);",
        f"{name}_unit(at, next);",
        *([f"for (int i = 0; i < {m}; i++) next[{SIZE} + i] = after[i];"] if m else []),
        "return 0;",
    ]
    return block(
        f"int {name}_step({real} t, {real} h, const {real} *s, const {real} *u, {real} *next)", lines
    )


def tests(system: System, precision: str) -> str:
    """Return a program that compares the functions with what the model said, and ends with the number of misses."""
    name, upper, real = system.name, system.name.upper(), f"{system.name}_real"
    say = Dialect(name, precision == "float")
    a = system.samples(CASES, seed=11)
    with torch.no_grad():
        rate = system.flow.rate(a["x"], a["u"], a["t"])
        after = system.steps.step(a["s"], a["u"], a["t"], a["h"])
    rows: dict[str, Any] = {
        "time": a["t"], "length": a["h"], "state": a["x"], "step_state": a["s"], "input": a["u"], "rate": rate,
        "after": after,
    }  # fmt: skip
    arrays = "\n".join(say.array(key, np.asarray(value).reshape(-1)) for key, value in rows.items())
    slope = "1e-3f" if say.single else "1e-6"
    rough = "2e-2f" if say.single else "1e-6"
    return f"""/* Written by {ORIGIN}: compares {name}.c with the model at {CASES} states; 0 if they agree. */
#include "{name}.h"

#include <math.h>
#include <stdio.h>

#define CASES {CASES}
#define NX {upper}_STATES
#define NS {upper}_STEP_STATES
#define NU {upper}_INPUTS

{arrays}
static int misses = 0;

/* Largest difference, relative to the largest element. */
static void compare(const char *what, const {real} *mine, const {real} *theirs, int count, {real} tolerance)
{{
    {real} error = 0, size = 0;
    for (int i = 0; i < count; i++) {{
        const {real} e = {say.function("abs")}(mine[i] - theirs[i]), s = {say.function("abs")}(theirs[i]);
        error = e > error || e != e ? e : error;
        size = s > size ? s : size;
    }}
    if (!(error <= tolerance * size)) {{
        printf("%s differs by %g of %g\\n", what, (double)error, (double)size);
        misses++;
    }}
}}

int main(void)
{{
    for (int c = 0; c < CASES; c++) {{
        const {real} *x = state + c * NX, *u = input + c * NU;
        {real} found[NX], next[NS], a[NX * NX], b[NX * NU], moved[NX], ahead[NX], behind[NX], slope[NX], own[NX];
        {name}_rate(time[c], x, u, found);
        compare("rate", found, rate + c * NX, NX, {say.number(TOLERANCE[precision])});
        if ({name}_step(time[c], length[c], step_state + c * NS, u, next)) {{
            printf("step refused\\n");
            misses++;
        }}
        compare("step", next, after + c * NS, NS, {say.number(TOLERANCE[precision])});
        /* A direction that is as good as any, by differences. */
        {name}_jacobian(time[c], x, u, a, b);
        for (int side = -1; side <= 1; side += 2) {{
            for (int i = 0; i < NX; i++) moved[i] = x[i] + ({real})side * {slope} * ({real})(1 + i % 3);
            {name}_rate(time[c], moved, u, side < 0 ? behind : ahead);
        }}
        for (int i = 0; i < NX; i++) {{
            slope[i] = (ahead[i] - behind[i]) / (2 * {slope});
            own[i] = 0;
            for (int j = 0; j < NX; j++) own[i] += a[i * NX + j] * ({real})(1 + j % 3);
        }}
        compare("jacobian", own, slope, NX, {rough});
    }}
    printf(misses ? "{name}: %d misses\\n" : "{name}: all agree\\n", misses);
    return misses != 0;
}}
"""
