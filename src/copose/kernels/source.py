"""C code of an expression.

CasADi writes C too, but for one point at a time. Here an instruction works on as many points side
by side as the processor's vectors hold, at the price of one. Operations are those of CasADi's
virtual machine in its order, none is contracted or reordered: both give the same bits.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

# What NumPy calls a processor with wide vectors, points a vector, and flags that let a compiler
# use it; every 64-bit processor has vectors of two.
_VECTORS = (
    ({"X86_V4", "AVX512_SKX"}, 8, ("-mavx2", "-mavx512f", "-mavx512dq", "-mavx512vl")),
    ({"X86_V3", "AVX2"}, 4, ("-mavx2",)),
    (None, 2, ()),
)
_EXTENSIONS = np.show_config("dicts")["SIMD Extensions"]
_FOUND = {*_EXTENSIONS.get("baseline", ()), *_EXTENSIONS.get("found", ())}
_LANES, _WIDE = next(
    (lanes, flags) for names, lanes, flags in _VECTORS if names is None or names & _FOUND
)
FLAGS = (
    "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-fast-math", "-fno-math-errno",
    "-Wno-psabi", *_WIDE,
)  # fmt: skip
# Compilers take more than linear time over a function; pieces of this length keep it short.
_PIECE = 400

_TWO = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_ONE = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    **{getattr(ca, f"OP_{name.upper()}"): f"each_{name}({{0}}, n)"
       for name in ("exp", "log")},
    **{getattr(ca, f"OP_{name.upper()}"): f"each_{name}({{0}})"
       for name in ("sqrt", "fabs", "sign", "not")},
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
typedef long long mask __attribute__((vector_size(8 * LANES)));
#define ALL(number) (number + (lanes){0})
#define PICK(which, a, b) ((lanes)(((mask)(a) & (which)) | ((mask)(b) & ~(which))))
#define EACH(name, arguments, formula) static inline lanes each_##name arguments { return formula; }
#define CALL(name) static inline lanes each_##name(lanes a, long n) { \\
  for (long k = 0; k < n; k++) a[k] = name(a[k]); return a; }
CALL(exp) CALL(log)
static inline void turn(lanes a, long n, lanes *sine, lanes *cosine) {
  for (long k = 0; k < n; k++) { double x = a[k]; (*sine)[k] = sin(x); (*cosine)[k] = cos(x); }
}
static inline lanes each_sqrt(lanes a) {
  for (int k = 0; k < LANES; k++) a[k] = sqrt(a[k]);
  return a;
}
EACH(fabs, (lanes a), (lanes)((mask)a & 0x7fffffffffffffffLL))
EACH(sign, (lanes a), PICK(a < 0, ALL(-1.0), PICK(a > 0, ALL(1.0), a)))
EACH(not, (lanes a), PICK(a == 0, ALL(1.0), ALL(0.0)))
EACH(fmin, (lanes a, lanes b), PICK((a < b) | (b != b), a, b))
EACH(fmax, (lanes a, lanes b), PICK((a > b) | (b != b), a, b))
EACH(less, (lanes a, lanes b), PICK(a < b, ALL(1.0), ALL(0.0)))
EACH(at_most, (lanes a, lanes b), PICK(a <= b, ALL(1.0), ALL(0.0)))
EACH(and, (lanes a, lanes b), PICK((a != 0) & (b != 0), ALL(1.0), ALL(0.0)))
EACH(or, (lanes a, lanes b), PICK((a != 0) | (b != 0), ALL(1.0), ALL(0.0)))
EACH(if, (lanes a, lanes b), PICK(a != 0, b, ALL(0.0)))
"""

_LOOP = """\
void evaluate(long count, const double *x, const double *p, long stride, double *y) {
  for (long s = 0; s < count; s += LANES) {
    lanes in[NX + NP + 1], out[NY];
    const long n = count - s < LANES ? count - s : LANES;
    for (int k = 0; k < LANES; k++) {
      const long row = k < n ? s + k : s;
      for (int j = 0; j < NX; j++) in[j][k] = x[row * NX + j];
      for (int j = 0; j < NP; j++) in[NX + j][k] = p[row * stride + j];
    }
    block(n, in, out);
    for (int k = 0; k < n; k++)
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
    lines, size = list[str](), function.sz_w()
    turned = dict[int, int]()  # place of the sine, before the cosine, of a number's that is there
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            lines.append(f"y[{made[1]}] = a[{given[0]}];")
            continue
        if operation == ca.OP_INPUT:
            value = f"x[{first[given[0]] + given[1]}]"
        elif operation == ca.OP_CONST:
            value = f"ALL({function.instruction_constant(k).hex()})"
        elif operation in (ca.OP_SIN, ca.OP_COS):
            angle = given[0]
            if angle not in turned:
                lines.append(f"turn(a[{angle}], n, &a[{size}], &a[{size + 1}]);")
                turned[angle], size = size, size + 2
            value = f"a[{turned[angle] + (operation == ca.OP_COS)}]"
        else:
            value = _value(operation, [f"a[{j}]" for j in given])
        lines.append(f"a[{made[0]}] = {value};")
        turned.pop(made[0], None)
    pieces = ["\n".join(lines[k : k + _PIECE]) for k in range(0, len(lines), _PIECE)]
    arguments = "long n, lanes *restrict a, const lanes *restrict x, lanes *restrict y"
    bodies = [
        f"static __attribute__((noinline)) void piece{j}({arguments}) {{\n{piece}\n}}\n"
        for j, piece in enumerate(pieces)
    ]
    calls = " ".join(f"piece{j}(n, a, x, y);" for j in range(len(pieces)))
    return "".join(
        [
            f"#define LANES {_LANES}\n#define NX {nx}\n#define NP {function.nnz_in(1)}\n"
            f"#define NY {function.nnz_out(0)}\n",
            _HEAD,
            *bodies,
            f"static void block(long n, const lanes *x, lanes *y) {{\n"
            f"  lanes a[{size}]; {calls}\n}}\n",
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
