"""Write scalar operations as C."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files

from auvnn.compiled.program import Layout, Program
from auvnn.compiled.scalars import Scalars
from auvnn.compiled.writer import Writer, number


def constant_part(scalars: Scalars, wanted: Iterable[int]) -> tuple[list[int], list[int]]:
    """Return what of the wanted nodes depends on parameters alone: all of it, and what the rest needs of it."""
    shared: dict[int, bool] = {}
    order = scalars.needed(wanted)
    for node in order:
        operation = scalars.operation[node]
        if operation in ("constant", "truth"):
            shared[node] = True
        elif operation == "input":
            shared[node] = scalars.operands[node][0] == "p"
        else:
            shared[node] = all(shared[n] for n in scalars.inputs_of(node))

    def own(node: int) -> bool:
        return shared[node] and scalars.operation[node] not in ("constant", "truth", "input")

    edge = {n for node in order if not shared[node] for n in scalars.inputs_of(node) if own(n)}
    edge |= {n for n in wanted if own(n)}
    # A matrix is no number: its elements are handed over. True and false are none either.
    plain = sorted(n for n in edge if scalars.operation[n] != "inverse" and not scalars.is_logical(n))
    return scalars.needed(plain), plain


def function_of(head: str, lines: Iterable[str]) -> str:
    """Return a function of C from its head and its statements."""
    return "\n".join([head + " {", *("    " + line for line in lines), "}", ""])


def write(
    layout: Layout,
    programs: tuple[Program, Program | None],
    projections: tuple[Program, Program],
    tableau: tuple[Sequence[float], Sequence[float]],
) -> str:
    """Return the C source of the functions and of the integrator over them.

    Args:
        layout: sizes.
        programs: the right-hand side, and with its vector-Jacobian product or None.
        projections: what is done to the state after each step, likewise.
        tableau: stage times and weights.
    """
    drive = layout.inputs[0][1] or 1
    plain, joint = programs
    used = joint or plain
    s = used.scalars
    # One graph serves both: the joint one holds the derivative as well.
    wanted = [
        *used.rate,
        *used.state_gradient,
        *used.input_gradient,
        *(n for _, n in used.parameter_gradient),
    ]
    _, edge = constant_part(s, wanted)
    places = {node: k for k, node in enumerate(edge)}
    held = range(drive, layout.width - 1)
    rows = sorted(
        s.operands[n][1] - drive
        for n in s.needed(wanted)
        if s.operation[n] == "input" and s.operands[n][0] == "u" and s.operands[n][1] in held
    )
    text = [
        table("NY", layout.state, "NU", layout.width, "NDRIVE", drive, "NROW", layout.width - drive - 1)
        + table("NB", len(edge), "NW", len(used.parameter_gradient), "STAGES", len(tableau[0]))
        + table("ROWS_USED", len(rows)),
        f"static const int ROW_USED[] = {{{', '.join(map(str, rows or [0]))}}};",
        f"static const double STAGE[] = {{{', '.join(number(c) for c in tableau[0])}}};",
        f"static const double WEIGHT[] = {{{', '.join(number(w) for w in tableau[1])}}};",
        REAL_HELP,
    ]
    hoist = Writer(s, {}, real=True)
    text.append(
        function_of(
            "static void prologue(const double *p, double *b)",
            [*hoist.body(edge), *hoist.store("b", edge)],
        )
    )
    arguments = "const V *restrict y, const V *restrict u, const double *restrict p, const double *restrict b"
    body = Writer(s, places)
    outside: Callable[[str], str] = lambda name: f"static __attribute__((noinline)) void {name}"  # noqa: E731
    text.append(
        function_of(
            f"{outside('rate')}({arguments}, V *restrict out)",
            [*body.body(used.rate), *body.store("out", used.rate)],
        )
    )
    after = Writer(projections[0].scalars, {})
    text.append(
        function_of(
            f"{outside('project')}(const V *y, V *out)",
            [*after.body(projections[0].rate), *after.store("out", projections[0].rate)],
        )
    )
    if joint is not None:
        grads = [n for _, n in joint.parameter_gradient]
        text.append("#define GRADIENT\n")
        text.append(
            function_of(
                f"{outside('rate_back')}({arguments}, const V *restrict ct, V *restrict gy, V *restrict gu, "
                "V *restrict gp)",
                [
                    *body.body([*joint.state_gradient, *joint.input_gradient, *grads]),
                    *body.store("gy", joint.state_gradient),
                    *body.store("gu", joint.input_gradient),
                    *body.store("gp", grads, "+="),
                ],
            )
        )
        back = Writer(projections[1].scalars, {})
        text.append(
            function_of(
                f"{outside('project_back')}(const V *y, const V *ct, V *gy)",
                [*back.body(projections[1].state_gradient), *back.store("gy", projections[1].state_gradient)],
            )
        )
    here = files("auvnn.compiled")
    prelude, scheme = (here.joinpath(n).read_text(encoding="utf-8") for n in ("prelude.h", "runge_kutta.c"))
    return "\n".join([prelude, *text, scheme])


REAL_HELP = """static inline double r_max(double a, double b) { return a > b || a != a ? a : b; }
static inline double r_min(double a, double b) { return a < b || a != a ? a : b; }
static inline double r_pick(int c, double a, double b) { return c ? a : b; }
#define R_AND(a, b) ((a) && (b))
#define R_OR(a, b) ((a) || (b))
#define R_NOT(a) (!(a))
"""


def table(*pairs: object) -> str:
    """Return definitions of names, each followed by its value, one to a line."""
    return "".join(f"#define {pairs[k]} {pairs[k + 1]}\n" for k in range(0, len(pairs), 2))
