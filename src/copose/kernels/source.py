"""C code of an expression.

CasADi writes C too, but for one point at a time. Here an instruction works on two points side by
side, which the vector units of every 64-bit processor do at the price of one. Operations are those
of CasADi's virtual machine in its order, none is contracted or reordered: both give the same bits.
"""

from __future__ import annotations

import casadi as ca

FLAGS = ("-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-fast-math", "-Wno-psabi")
_LANES = 2
# Compilers take more than linear time over a function; pieces of this length keep it short.
_PIECE = 400

_TWO = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_ONE = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    **{getattr(ca, f"OP_{name.upper()}"): f"each_{name}({{0}})"
       for name in ("sin", "cos", "exp", "log", "sqrt", "fabs", "sign", "not")},
}  # fmt: skip
_PAIR = {
    ca.OP_FMIN: "each_fmin({0}, {1})",
    ca.OP_FMAX: "each_fmax({0}, {1})",
    ca.OP_LT: "each_less({0}, {1})",
    ca.OP_LE: "each_at_most({0}, {1})",
    ca.OP_AND: "each_and({0}, {1})",
    ca.OP_OR: "each_or({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "each_if({0}, {1})",
}

_HEAD = """\
#include <math.h>
#include <string.h>
typedef double lanes __attribute__((vector_size(8 * LANES)));
#define EACH1(name, formula) static inline lanes each_##name(lanes a) { lanes r; \\
  for (int k = 0; k < LANES; k++) { double x = a[k]; r[k] = formula; } return r; }
#define EACH2(name, formula) static inline lanes each_##name(lanes a, lanes b) { lanes r; \\
  for (int k = 0; k < LANES; k++) { double x = a[k], y = b[k]; r[k] = formula; } return r; }
EACH1(sin, sin(x)) EACH1(cos, cos(x)) EACH1(exp, exp(x)) EACH1(log, log(x)) EACH1(sqrt, sqrt(x))
EACH1(fabs, fabs(x)) EACH1(sign, x < 0 ? -1 : x > 0 ? 1 : x) EACH1(not, !x)
EACH2(fmin, fmin(x, y)) EACH2(fmax, fmax(x, y)) EACH2(less, x < y) EACH2(at_most, x <= y)
EACH2(and, x && y) EACH2(or, x || y) EACH2(if, x ? y : 0)
"""

_LOOP = """\
void evaluate(long count, const double *x, const double *p, long stride, double *y) {
  for (long s = 0; s < count; s += LANES) {
    lanes in[NX + NP + 1], out[NY];
    for (int k = 0; k < LANES; k++) {
      const long row = s + k < count ? s + k : s;
      for (int j = 0; j < NX; j++) in[j][k] = x[row * NX + j];
      for (int j = 0; j < NP; j++) in[NX + j][k] = p[row * stride + j];
    }
    block(in, out);
    for (int k = 0; k < LANES && s + k < count; k++)
      for (int j = 0; j < NY; j++) y[(s + k) * NY + j] = out[j][k];
  }
}
"""


def c_source(function: ca.Function) -> str:
    """C code of ``void evaluate(count, x, p, stride, y)``.

    Args:
        function: of expressions, (nx,) and (np,) to (ny,), all dense.

    Raises:
        NotImplementedError: it uses an operation that has no C code here.
    """
    nx = function.nnz_in(0)
    first = {0: 0, 1: nx}
    lines = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            lines.append(f"y[{made[1]}] = a[{given[0]}];")
            continue
        if operation == ca.OP_INPUT:
            value = f"x[{first[given[0]] + given[1]}]"
        elif operation == ca.OP_CONST:
            value = f"{function.instruction_constant(k).hex()} + (lanes){{0}}"
        else:
            value = _value(operation, [f"a[{j}]" for j in given])
        lines.append(f"a[{made[0]}] = {value};")
    pieces = ["\n".join(lines[k : k + _PIECE]) for k in range(0, len(lines), _PIECE)]
    arguments = "lanes *restrict a, const lanes *restrict x, lanes *restrict y"
    bodies = [
        f"static __attribute__((noinline)) void piece{j}({arguments}) {{\n{piece}\n}}\n"
        for j, piece in enumerate(pieces)
    ]
    calls = " ".join(f"piece{j}(a, x, y);" for j in range(len(pieces)))
    return "".join(
        [
            f"#define LANES {_LANES}\n#define NX {nx}\n#define NP {function.nnz_in(1)}\n"
            f"#define NY {function.nnz_out(0)}\n",
            _HEAD,
            *bodies,
            f"static void block(const lanes *x, lanes *y) {{\n"
            f"  lanes a[{function.sz_w()}]; {calls}\n}}\n",
            _LOOP,
        ]
    )


def _value(operation: int, operands: list[str]) -> str:
    if operation in _TWO:
        return f" {_TWO[operation]} ".join(operands)
    template = _ONE.get(operation) or _PAIR.get(operation)
    if template is None:
        raise NotImplementedError(f"CasADi operation {operation}")
    return template.format(*operands)
