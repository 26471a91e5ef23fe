"""The Hessian of a program's Lagrangian, by differences of its exact gradient."""

from __future__ import annotations

import casadi as ca

_STEP = 1e-7


def differenced_hessian(nlp: dict[str, ca.SX]) -> ca.Function:
    """Upper triangle of ∇²ₓ(λ_f f + λ_gᵀ g), in the form that CasADi's nlpsol takes.

    Column j is (∇L(x + h e_j) − ∇L(x)) / h. Written out as an expression the Hessian of two
    seven-joint arms takes 300,000 instructions; without one, quasi-Newton steps run out of
    iterations where light wrist joints leave the objective nearly flat. Its error, about 1e-7,
    slows convergence a little and moves no solution.

    Args:
        nlp: expressions ``x``, ``p``, ``f`` and ``g``.
    """
    x, p = nlp["x"], nlp["p"]
    n, n_g, n_p = x.shape[0], nlp["g"].shape[0], p.shape[0]
    lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", n_g)
    lagrangian = lam_f * nlp["f"] + ca.dot(lam_g, nlp["g"])
    gradient = ca.Function("gradient", [x, p, lam_f, lam_g], [ca.gradient(lagrangian, x)])

    at, parameters = ca.MX.sym("x", n), ca.MX.sym("p", n_p)
    weight, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n_g)
    count = n + 1
    points = ca.repmat(at, 1, count) + _STEP * ca.horzcat(ca.DM(n, 1), ca.DM.eye(n))
    slopes = gradient.map(count)(
        points,
        ca.repmat(parameters, 1, count),
        ca.repmat(weight, 1, count),
        ca.repmat(multipliers, 1, count),
    )
    columns = (slopes[:, 1:] - ca.repmat(slopes[:, 0], 1, n)) / _STEP
    return ca.Function(
        "nlp_hess_l",
        [at, parameters, weight, multipliers],
        [ca.triu((columns + columns.T) / 2)],
        ["x", "p", "lam_f", "lam_g"],
        ["triu_hess_gamma_x_x"],
    )
