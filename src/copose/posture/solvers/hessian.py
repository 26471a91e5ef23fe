"""The Hessian of a program's Lagrangian, by differences of its exact gradient."""

from __future__ import annotations

import casadi as ca


def differenced_hessian(nlp: dict[str, ca.SX], differenced: int, step: float = 1e-7) -> ca.Function:
    """Upper triangle of ∇²ₓ(λ_f f + λ_gᵀ g), in the form that CasADi's nlpsol takes.

    Column j of the first ``differenced`` is (∇L(x + h e_j) − ∇L(x)) / h; the others, in which the
    Lagrangian is simple, are exact. Written out as an expression the Hessian of two seven-joint
    arms takes 300,000 instructions; without one, quasi-Newton steps run out of iterations where
    light wrist joints leave the objective nearly flat. The error, about 1e-7, slows convergence a
    little and moves no solution.

    Args:
        nlp: expressions ``x``, ``p``, ``f`` and ``g``.
        differenced: how many of the variables, the first ones, are differenced.
        step: h, rad or m.
    """
    x, p = nlp["x"], nlp["p"]
    lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", nlp["g"].shape[0])
    lagrangian = lam_f * nlp["f"] + ca.dot(lam_g, nlp["g"])
    symbols = [x, p, lam_f, lam_g]
    slope = ca.gradient(lagrangian, x)
    gradient = ca.Function("gradient", symbols, [slope[:differenced]])
    exact = ca.Function("exact", symbols, [ca.jacobian(slope, x[differenced:])])

    names = ["x", "p", "lam_f", "lam_g"]
    inputs = [ca.MX.sym(name, s.shape[0]) for name, s in zip(names, symbols, strict=True)]
    count, rest = differenced + 1, x.shape[0] - differenced
    steps = ca.diagcat(step * ca.horzcat(ca.DM(differenced, 1), ca.DM.eye(differenced)),
                       ca.DM(rest, 0))  # fmt: skip
    points = ca.repmat(inputs[0], 1, count) + steps
    slopes = gradient.map(count)(points, *(ca.repmat(value, 1, count) for value in inputs[1:]))
    columns = (slopes[:, 1:] - ca.repmat(slopes[:, 0], 1, differenced)) / step
    columns = ca.vertcat((columns + columns.T) / 2, ca.MX(rest, differenced))
    return ca.Function(
        "nlp_hess_l",
        inputs,
        [ca.triu(ca.horzcat(columns, exact(*inputs)))],
        names,
        ["triu_hess_gamma_x_x"],
    )
