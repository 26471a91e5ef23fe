"""Where the remarks of the paper on its ellipsoids end, counted over random postures.

Two of the paper's arms (three links of 0.4 m, 1 kg, 0.03 kg·m² about the midpoint) hold an object
between them in the plane by hinges; joints are independent and uniform in (−π, π)³, the bases
stand wherever the grasps then are. With hinges W = I, so that only the joints matter.

    python benchmarks/paper_remarks.py [--postures 20000] [--seed 0]
"""

from __future__ import annotations

import argparse

import casadi as ca
import numpy as np

import copose
from copose.capability import RESOLUTIONS
from copose.mechanics import System, object_parameters
from copose.robots import load_arms

LINK = {"length": 0.4, "mass": 1.0, "inertia": 0.03, "com": 0.2}


def grams(postures: int, seed: int) -> dict[str, np.ndarray]:
    """Gram matrices (postures, 2, 2) by resolution, of the pair without and with the object."""
    arms = [
        {"name": f"a{i}", "links": [LINK] * 3, "grasp": {"position": [0.0, 0.0]}} for i in (1, 2)
    ]
    problem = copose.parse(
        {
            "format": 1, "name": "pair", "task": {"space": "planar-linear"},
            "object": {"mass": 0.05, "position": [0.0, 0.0]}, "arms": arms,
        }
    )  # fmt: skip
    system = System.of(problem.space, load_arms(problem))
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (6, postures))
    ones = [np.ones(3), np.ones(3)]
    found = {}
    for name, resolution in RESOLUTIONS.items():
        outputs = {"pair": resolution.system_gram(system, ones)}
        for i, arm in enumerate(system.arms):
            own = resolution.own_factor(arm, ones[i])
            outputs[f"arm {i + 1}"] = own.T @ own
        for kind, expression in outputs.items():
            function = ca.Function("G", [system.q, system.object.parameters], [ca.vec(expression)])
            for mass in (0.0, 0.05):
                parameters = object_parameters(problem.object.pose, mass, 0.0)
                values = np.array(function(q, parameters)).T.reshape(-1, 2, 2)
                found[f"{name}, {kind}, {mass} kg"] = values
    return found


def longer_somewhere(G: np.ndarray, than: np.ndarray, by: float = 0.0) -> np.ndarray:
    """Whether uᵀGu < (1 − by) uᵀG'u for some u: the ellipsoid of G is longer there."""
    return np.linalg.eigvalsh(G - (1 - by) * than)[:, 0] < -1e-12 * np.trace(than, axis1=1, axis2=2)


def figures(postures: int = 20_000, seed: int = 0) -> dict[str, float]:
    """The shares, in percent, and the volume ratios."""
    found = grams(postures, seed)
    light, heavy = (found[f"pseudoinverse, pair, {mass} kg"] for mass in (0.0, 0.05))
    shares = {
        "object, longer somewhere": longer_somewhere(heavy, light),
        "object, longer by 1 % of aᵀGa": longer_somewhere(heavy, light, 0.01),
        "object, larger volume": np.linalg.det(heavy) < np.linalg.det(light),
    }
    for mass, words in ((0.0, "massless object"), (0.05, "0.05 kg object")):
        pair = found[f"torque-optimal, pair, {mass} kg"]
        single = [found[f"torque-optimal, arm {i}, {mass} kg"] for i in (1, 2)]
        beats = longer_somewhere(pair, single[0]) | longer_somewhere(pair, single[1])
        shares[f"pair beats an arm, {words}"] = beats
    optimal = found["torque-optimal, pair, 0.05 kg"]
    ratio = np.sqrt(np.linalg.det(heavy) / np.linalg.det(optimal))
    result = {name: 100 * float(np.mean(share)) for name, share in shares.items()}
    for name, percent in (("lower quartile", 25), ("median", 50), ("upper quartile", 75)):
        result[f"volume ratio, {name}"] = float(np.percentile(ratio, percent))
    return result


def main() -> None:
    """Print the figures as a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--postures", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    found = figures(arguments.postures, arguments.seed)
    rows = [
        ("a 0.05 kg object makes the paper's ellipsoid longer in some direction",
         f"{found['object, longer somewhere']:.0f} % of postures"),
        ("… by over 1 % of aᵀGa", f"{found['object, longer by 1 % of aᵀGa']:.0f} %"),
        ("… makes its volume larger", f"{found['object, larger volume']:.1f} %"),
        ("torque-optimally the pair out-accelerates one of its arms somewhere, massless object",
         f"{found['pair beats an arm, massless object']:.0f} %"),
        ("… with the 0.05 kg object", f"{found['pair beats an arm, 0.05 kg object']:.0f} %"),
        ("torque-optimal over the paper's volume, quartiles",
         " … ".join(f"{found[f'volume ratio, {name}']:.1f}"
                    for name in ("lower quartile", "median", "upper quartile"))),
    ]  # fmt: skip
    print(f"| over {arguments.postures:,} random postures | |\n| --- | --- |")
    for what, value in rows:
        print(f"| {what} | {value} |")


if __name__ == "__main__":
    main()
