"""Write scalar operations as C."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files

from auvnn.compiled.program import Layout, Program
from auvnn.compiled.scalars import FUNCTIONS, Scalars

INLINE = ("sqrt", "floor", "ceil")
"""Functions that are an instruction; all others run over arrays, several numbers at once."""

INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!="}
CALLS = {"max": "v_max", "min": "v_min", "pow": "v_pow", "atan2": "v_atan2", "and": "AND", "or": "OR"}


def number(value: float) -> str:
    """Return a number in C, exactly."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return f"({value.hex()})" if value < 0 else value.hex()


@dataclass(frozen=True)
class Writer:
    """Writes straight-line functions over one graph.

    Args:
        scalars: the graph.
        hoisted: nodes that the prologue has worked out already, and their places in `b`.
        real: whether numbers are plain doubles (the prologue) rather than vectors of lanes.
    """

    scalars: Scalars
    hoisted: dict[int, int]
    real: bool = False

    def _name(self, node: int, vector: bool = False) -> str:
        s = self.scalars
        if s.operation[node] == "truth":
            return "TRUE" if s.value(node) else "FALSE"
        value = s.value(node)
        if value is not None:
            text = number(float(value))
        elif node in self.hoisted:
            text = f"b[{self.hoisted[node]}]"
        elif s.operation[node] == "input":
            kind, index = s.operands[node]
            text = f"{kind}[{index}]"
            vector = vector and kind == "p"
        else:
            return f"t{node}"
        # One number for all lanes must be spread where the other operand does not do so.
        return f"SPREAD({text})" if vector and not self.real else text

    def _shared(self, node: int) -> bool:
        """Return whether a node is one number for all lanes."""
        s = self.scalars
        return (
            s.is_constant(node)
            or node in self.hoisted
            or (s.operation[node] == "input" and s.operands[node][0] == "p")
        )

    def body(self, wanted: Iterable[int]) -> list[str]:
        """Return the statements that compute the wanted nodes."""
        s, lines, done = self.scalars, [], set()
        stop = self.hoisted
        seen, stack = set(), [n for n in wanted if n not in stop]
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(n for n in s.inputs_of(node) if n not in stop)
        order = sorted(seen)
        groups: dict[int, list[int]] = {}
        for node in order:
            if s.operation[node] in FUNCTIONS and s.operation[node] not in INLINE:
                groups.setdefault(s.group.get(node) or -node, []).append(node)
        kind = "double" if self.real else "V"
        lanes = "1" if self.real else "LANES"
        for node in order:
            operation, operands = s.operation[node], s.operands[node]
            if node in done or operation in ("constant", "truth", "input"):
                continue
            if operation in FUNCTIONS and operation not in INLINE:
                members = groups[s.group.get(node) or -node]
                # Room to whole vectors, whatever their width: what is beyond is computed for nothing.
                size = -(-len(members) // 8) * 8
                lines.append(
                    f"{kind} i{node}[{size}] __attribute__((aligned(64))), "
                    f"o{node}[{size}] __attribute__((aligned(64)));"
                )
                lines += [
                    f"i{node}[{k}] = {self._name(s.operands[m][0], True)};" for k, m in enumerate(members)
                ]
                lines += [f"i{node}[{k}] = i{node}[0];" for k in range(len(members), size)]
                lines.append(
                    f"many_{operation}((const double *)i{node}, (double *)o{node}, {len(members)} * {lanes});"
                )
                lines += [f"const {kind} t{m} = o{node}[{k}];" for k, m in enumerate(members)]
                done.update(members)
                continue
            if operation == "inverse":
                lines += self._inverse(node, operands)
                continue
            if operation == "take":
                lines.append(f"const {kind} t{node} = m{operands[0]}[{operands[1]}];")
                continue
            lines.append(self._statement(node, operation, operands))
        return lines

    def _statement(self, node: int, operation: str, operands: tuple) -> str:
        s = self.scalars
        vector = all(self._shared(n) for n in operands)
        kind = "double" if self.real else "V"
        if s.is_logical(node):
            kind = "int" if self.real else "B"
        if operation in INFIX:
            first = self._name(operands[0], vector or operation in ("lt", "le", "eq", "ne"))
            text = (
                f"{first} {INFIX[operation]} {self._name(operands[1], operation in ('lt', 'le', 'eq', 'ne'))}"
            )
        elif operation == "neg":
            text = f"-{self._name(operands[0], True)}"
        elif operation == "abs":
            text = f"v_abs({self._name(operands[0], True)})"
        elif operation == "not":
            text = f"NOT({self._name(operands[0])})"
        elif operation == "where":
            c, a, b = operands
            text = f"pick({self._name(c)}, {self._name(a, True)}, {self._name(b, True)})"
        elif operation in INLINE:
            text = f"v_{operation}({self._name(operands[0], True)})"
        else:
            text = f"{CALLS[operation]}({', '.join(self._name(n, True) for n in operands)})"
        if self.real:
            for vectorial, plain in REAL.items():
                text = text.replace(vectorial, plain)
        return f"const {kind} t{node} = {text};"

    def _inverse(self, node: int, operands: tuple) -> list[str]:
        size, elements = operands[0], operands[1:]
        if self.real:
            fill = [f"a{node}[{k}] = {self._name(n)};" for k, n in enumerate(elements)]
            count = size * size
            return [
                f"double a{node}[{count}], m{node}[{count}];",
                *fill,
                f"invert(a{node}, m{node}, {size});",
            ]
        count = size * size
        return [
            f"V a{node}[{count}], m{node}[{count}];",
            *(f"a{node}[{k}] = {self._name(n, True)};" for k, n in enumerate(elements)),
            "for (int l = 0; l < LANES; l++) {",
            f"double one[{count}], other[{count}];",
            f"for (int i = 0; i < {count}; i++) one[i] = LANE(a{node}[i], l);",
            f"invert(one, other, {size});",
            f"for (int i = 0; i < {count}; i++) LANE(m{node}[i], l) = other[i];",
            "}",
        ]

    def store(self, place: str, nodes: Sequence[int], sign: str = "=") -> list[str]:
        """Return the statements that leave nodes in an array."""
        return [f"{place}[{k}] {sign} {self._name(n, True)};" for k, n in enumerate(nodes)]


REAL = {"v_abs(": "fabs(", "v_sqrt(": "sqrt(", "v_floor(": "floor(", "v_ceil(": "ceil(", "v_pow(": "pow(",
        "v_atan2(": "atan2(", "v_max(": "r_max(", "v_min(": "r_min(", "pick(": "r_pick(", "AND(": "R_AND(",
        "NOT(": "R_NOT(", "OR(": "R_OR(", "TRUE": "1", "FALSE": "0"}  # fmt: skip


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


def _function(head: str, lines: Iterable[str]) -> str:
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
        _table("NY", layout.state, "NU", layout.width, "NDRIVE", drive, "NROW", layout.width - drive - 1)
        + _table("NB", len(edge), "NW", len(used.parameter_gradient), "STAGES", len(tableau[0]))
        + _table("ROWS_USED", len(rows)),
        f"static const int ROW_USED[] = {{{', '.join(map(str, rows or [0]))}}};",
        f"static const double STAGE[] = {{{', '.join(number(c) for c in tableau[0])}}};",
        f"static const double WEIGHT[] = {{{', '.join(number(w) for w in tableau[1])}}};",
        REAL_HELP,
    ]
    hoist = Writer(s, {}, real=True)
    text.append(
        _function(
            "static void prologue(const double *p, double *b)",
            [*hoist.body(edge), *hoist.store("b", edge)],
        )
    )
    arguments = "const V *restrict y, const V *restrict u, const double *restrict p, const double *restrict b"
    body = Writer(s, places)
    outside: Callable[[str], str] = lambda name: f"static __attribute__((noinline)) void {name}"  # noqa: E731
    text.append(
        _function(
            f"{outside('rate')}({arguments}, V *restrict out)",
            [*body.body(used.rate), *body.store("out", used.rate)],
        )
    )
    after = Writer(projections[0].scalars, {})
    text.append(
        _function(
            f"{outside('project')}(const V *y, V *out)",
            [*after.body(projections[0].rate), *after.store("out", projections[0].rate)],
        )
    )
    if joint is not None:
        grads = [n for _, n in joint.parameter_gradient]
        text.append("#define GRADIENT\n")
        text.append(
            _function(
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
            _function(
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


def _table(*pairs: object) -> str:
    return "".join(f"#define {pairs[k]} {pairs[k + 1]}\n" for k in range(0, len(pairs), 2))
