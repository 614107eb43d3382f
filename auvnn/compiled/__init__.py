"""Right-hand sides written in torch, as machine code: traced, written as C, compiled, and checked.

The physics is stated once, in torch. Here that statement is watched while it runs (`recorder`), operation by
operation (`rules`, `operations`). This gives a graph of scalar operations (`scalars`) for the derivative and, since
autograd's own operations are watched as well, for its vector-Jacobian product (`program`). Both are written as C
(`source`), with a Runge-Kutta scheme and its discrete adjoint around them (`runge_kutta.c`), compiled by the system's
compiler (`toolchain`), compared with torch (`check`) and called as a function of tensors with a gradient (`kernel`).

Why C and not inductor or numba: the whole loop over steps must be compiled, or calling costs more than computing.
Inductor unrolls such a loop and takes minutes for ten steps; numba takes 10 s for code of this size and is one
more dependency. A C compiler takes 0.5 s for a right-hand side, 2 to 4 s with its gradient, and is there on most
machines; where it is not, plain torch goes on working.
"""
