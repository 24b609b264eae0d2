"""The appendix of aranovskiy2020 and Proposition 1 of sokolov2019: the gyroscope is not PLvCC, checked symbolically.

A mechanical system is partially linearisable via coordinate changes (PLvCC) if a full-rank Psi(q) makes every B_(i)
skew-symmetric, by aranovskiy2020's appendix. The decision for M = diag(m1(q2), 1):

1. B_(i) + B_(i)' is the Lie derivative of the inverse of M along the column Psi_i. So B_(i) is skew-symmetric exactly
   if Psi_i is a Killing field of the metric M, whatever the other column is.
2. A Killing field (b, d) of diag(m1(q2), 1) has d = d(q1), and m1 (m1'/m1)' d = 2 d''. If d is not zero at some q1,
   then m1 (m1'/m1)' is a constant. If it is zero everywhere, for both columns, the second row of Psi is zero.
3. Where m1 (m1'/m1)' is a constant C, Psi = [[1, b], [0, d]] with d'' = C d/2 does it: the condition is sufficient
   too. det Psi = d. For C >= 0 it is nowhere zero; for C < 0 Psi has full rank on strips of q1 only. Constant C means
   m1 = f^2 with f'' = k f, and an f without zeros on the whole line has C >= 0.

`proof` checks each of these steps, and decides on the papers' m1 and on inertias for which the answer is yes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import sympy as sp
from sympy.polys.fields import sfield

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.cube import CUBE, inertias

q1, q2 = q = sp.symbols("q1 q2", real=True)
"""Tilt and gimbal angle."""

# --- the definition -----------------------------------------------------------------------------------------


def bracket(X: Any, Y: Any) -> Any:
    """Return the Lie bracket [X, Y] = dY/dq X - dX/dq Y, as sokolov2019 prints it, (2, 1).

    aranovskiy2020 prints q_i and q_j for q, which gives no vector.
    """
    return Y.jacobian(q) * X - X.jacobian(q) * Y


def B(i: int, Psi: Any, M: Any, point: Mapping[Any, Any] | None = None) -> Any:
    """Return B_(i), aranovskiy2020 appendix, (2, 2).

    Args:
        i: Number of the column of Psi, from 0.
        Psi: The change of velocities, (2, 2).
        M: The inertia matrix, (2, 2).
        point: Point to evaluate it at, coordinate -> value. Putting that in early keeps the expressions small.
    """

    def at(matrix: Any) -> Any:
        return matrix.subs(point or {})

    N = Psi.T * M * Psi
    first, second = at(M * Psi * Psi.T).inv(), at(N).inv()
    result = sp.zeros(2, 2)
    for j in range(2):
        result += at(bracket(Psi[:, i], Psi[:, j]) * Psi[:, j].T) * first
        derivative = -second * at(N.diff(q[j])) * second  # of the inverse of N
        result += at(Psi[j, i] * Psi) * derivative * at(Psi.T) / 2
    return result


def lie_derivative(X: Any, M: Any) -> Any:
    """Return the Lie derivative of the inverse of M along X, (2, 2): zero exactly if X is a Killing field of M."""
    inverse = M.inv()
    directional_derivative = sum((X[k] * inverse.diff(q[k]) for k in range(2)), sp.zeros(2, 2))
    return directional_derivative - X.jacobian(q) * inverse - inverse * X.jacobian(q).T


def vanishes(expression: Any) -> bool:
    """Return true if a quotient of polynomials in q, sines, cosines and exponentials is zero.

    sympy's simplify does this too, in minutes for some of the expressions here.
    """

    def lower_power(power: Any) -> Any:
        return (1 - sp.cos(power.base.args[0]) ** 2) ** (power.exp // 2) * power.base ** (power.exp % 2)

    expression = sp.sympify(expression).rewrite((sp.sinh, sp.cosh, sp.tanh), sp.exp)
    if expression.is_rational_function():
        return not sfield(expression)[1]  # faster than the rest
    numerator = sp.expand(sp.fraction(sp.together(expression))[0])
    numerator = numerator.replace(
        lambda part: part.is_Pow and isinstance(part.base, sp.sin) and part.exp.is_Integer and part.exp > 1, lower_power
    )
    return sp.expand(numerator) == 0


def is_skew(matrix: Any) -> bool:
    """Return true if A + A' is zero."""
    return all(map(vanishes, matrix + matrix.T))


# --- the decision -------------------------------------------------------------------------------------------


def condition(m1: Any) -> Any:
    """Return m1 (m1'/m1)' = m1'' - m1'^2/m1, which by the paper's necessary condition is constant."""
    return sp.diff(m1, q2, 2) - sp.diff(m1, q2) ** 2 / m1


def explicit_psi(m1: Any, C: Any) -> Any:
    """Return the Psi of step 3 for an m1 with m1 (m1'/m1)' = C, (2, 2)."""
    slope = sp.diff(m1, q2) / m1
    if C.is_zero:
        return sp.Matrix([[1, -q1 * slope / 2], [0, 1]])
    rate = sp.sqrt(abs(C) / 2)
    d = sp.exp(rate * q1) if C.is_positive else sp.cos(rate * q1)
    return sp.Matrix([[1, -sp.diff(d, q1) * slope / C], [0, d]])


class Decision(NamedTuple):
    """The decision whether M = diag(m1(q2), 1) is PLvCC."""

    m1: Any
    """The inertia decided on."""
    Psi: Any
    """One that does it; None if there is none."""
    values: Mapping[Any, Any]
    """m1 (m1'/m1)' by q2: one value if it is constant, two that differ if it is not."""

    @property
    def figures(self) -> dict[str, Any]:
        """The decision for a claim's figures."""
        values = {str(angle): str(value) for angle, value in self.values.items()}
        return {"m1": str(self.m1), "plvcc": self.Psi is not None, "condition_by_q2": values}


def decide(m1: Any) -> Decision:
    """Decide whether M = diag(m1(q2), 1) is partially linearisable via coordinate changes.

    Args:
        m1: An expression in q2. Other symbols stand for any value that keeps it positive.

    Returns:
        The decision. A yes comes with a Psi, whose B_(i) were found skew-symmetric by substitution in the definition;
        a no with two angles at which m1 (m1'/m1)' is not the same.
    """
    value = condition(m1)
    values = {
        angle: sp.factor(value.subs(q2, angle))
        for angle in (sp.Integer(0), sp.pi / 2, sp.pi / 4, sp.Integer(1))
        if not vanishes(m1.subs(q2, angle))
    }
    angle, C = next(iter(values.items()))
    for other_angle, other_value in values.items():
        difference = sp.factor(other_value - C)
        if difference.is_zero is False or (difference.free_symbols and not vanishes(difference)):
            return Decision(m1, None, {angle: C, other_angle: other_value})
    Psi = explicit_psi(m1, C)
    assert all(is_skew(B(i, Psi, sp.diag(m1, 1))) for i in range(2)), f"m1 = {m1}: undecided"
    return Decision(m1, Psi, {angle: C})


# --- the papers' inertia ------------------------------------------------------------------------------------

PRINTED = {"aranovskiy2020": ("Appendix", 2, 0.19), "sokolov2019": ("Proposition 1", 1, 0.13)}
"""Paper -> place at which it says that the system is not PLvCC; the gimbals of m1 = gimbals (J1 + J2 cos^2 q2)/
(I_c + I_d) as printed; distance from the tilt axis of the mass m, which J1 holds as m arm^2/gimbals [m]."""


def papers_m1(paper: str, numbers: bool = False) -> Any:
    """Return m1 as printed, with the symbols J1, J2 and I_c + I_d, or with the exact numbers of Table 1 (Table I)."""
    J1, I_cd = sp.symbols("J1 I_cd", positive=True)
    J2 = sp.Symbol("J2", real=True, nonzero=True)
    _, gimbals, arm = PRINTED[paper]
    m1 = gimbals * (J1 + J2 * sp.cos(q2) ** 2) / I_cd
    if not numbers:
        return m1
    exact = {name: sp.Rational(str(number)) for name, number in {**CUBE, "l": arm}.items()}
    J1_number, J2_number = inertias(exact, gimbals)
    return m1.subs({J1: J1_number, J2: J2_number, I_cd: exact["I_c"] + exact["I_d"]})


def inertia_factor(gimbals: int) -> int:
    """Return the s of m1 = s (J1 + J2 cos^2 q2)/(I_c + I_d) for which the motion is that of diag(m1, 1).

    With T = (M11 w_b^2 + M22 w_c^2)/2, the gimbal's equation is M22 w_c' - M11' w_b^2/2. In both papers the quotient of
    those terms is (J2/2) sin(2 q_c)/(I_c + I_d), with M11 = n (J1 + J2 cos^2 q_c) for n gimbals.
    """
    J1, J2, I_cd, q_c = sp.symbols("J1 J2 I_cd q_c", positive=True)
    one_gimbal = J1 + J2 * sp.cos(q_c) ** 2
    M11 = gimbals * one_gimbal
    M22 = -sp.diff(M11, q_c) / 2 / (J2 / 2 * sp.sin(2 * q_c) / I_cd)
    return int(sp.simplify(M11 / M22 * I_cd / one_gimbal))


# --- the proof's steps --------------------------------------------------------------------------------------


def jet(name: str) -> Any:
    """Write a function by its value and first derivatives at q = 0, `name + name_1 q1 + name_2 q2`.

    B_(i) holds no higher derivatives, and q = 0 may be any point: what is so for these is so for all functions.
    """
    value, first, second = sp.symbols(f"{name} {name}_1 {name}_2")
    return value + first * q1 + second * q2


ANY_PSI = sp.Matrix([[jet("a"), jet("b")], [jet("c"), jet("d")]])
"""Any Psi(q), to first order at q = 0, (2, 2)."""
ANY_M1 = sp.diag(jet("m").subs(sp.Symbol("m_1"), 0), 1)
"""diag(m1(q2), 1) with any m1, to first order at q = 0, (2, 2)."""
ORIGIN = dict.fromkeys(q, 0)


def symmetric_part_is_lie_derivative(i: int, M: Any) -> bool:
    """Step 1 for one column and any Psi, at q = 0."""
    matrix = B(i, ANY_PSI, M, ORIGIN)
    return all(map(vanishes, matrix + matrix.T - lie_derivative(ANY_PSI[:, i], M).subs(ORIGIN)))


def printed_entries() -> dict[str, bool]:
    """Compare the definition with the appendix's entries of B_(2), for any Psi and any m1(q2)."""
    matrix = B(1, ANY_PSI, ANY_M1, ORIGIN)
    m, dm, d, b_1, b_2, d_1, d_2 = sp.symbols("m m_2 d b_1 b_2 d_1 d_2")
    pairs = {
        "B_(2)22": (matrix[1, 1], -d_2),
        "B_(2)11": (matrix[0, 0], (-2 * m * b_1 - d * dm) / (2 * m**2)),
        "B_(2)12 + B_(2)21": (matrix[0, 1] + matrix[1, 0], -(d_1 + m * b_2) / m),
    }
    return {name: vanishes(entry - formula) for name, (entry, formula) in pairs.items()}


def mixed_derivatives() -> bool:
    """Step 2: whether the two expressions for db/dq demand m1 (m1'/m1)' d = 2 d''.

    The appendix prints it with the other sign, which does not touch its conclusion.
    """
    m1, d = sp.Function("m1")(q2), sp.Function("d")(q1)
    db_dq1 = -d / (2 * m1) * sp.diff(m1, q2)
    db_dq2 = -sp.diff(d, q1) / m1
    difference = sp.diff(db_dq1, q2) - sp.diff(db_dq2, q1)
    demanded = condition(m1) * d - 2 * sp.diff(d, q1, 2)
    return vanishes(2 * m1 * difference + demanded)


def proof_steps() -> dict[str, bool]:
    """Check the proof step by step: step in words -> whether it was found so."""
    A, D, k = sp.symbols("A D k", positive=True)
    f, family = sp.Function("f")(q2), (A * sp.exp(k * q2) + D * sp.exp(-k * q2)) ** 2
    steps = {f"{name} is as printed": right for name, right in printed_entries().items()}
    for i in range(2):
        steps[f"B_({i + 1}) is skew-symmetric exactly if column {i + 1} is a Killing field"] = (
            symmetric_part_is_lie_derivative(i, ANY_M1)
        )
    steps["the mixed derivatives of b demand m1 (m1'/m1)' d = 2 d''"] = mixed_derivatives()
    steps["for m1 = f^2, m1 (m1'/m1)' is constant exactly if f''/f is"] = vanishes(
        sp.diff(condition(f**2), q2) - 2 * f**2 * sp.diff(sp.diff(f, q2, 2) / f, q2)
    )
    steps["it is 8 A D k^2 for f = A exp(k q2) + D exp(-k q2)"] = vanishes(condition(family) - 8 * A * D * k**2)
    return steps


def claim(paper: str) -> Claim:
    """Judge the appendix of aranovskiy2020, or Proposition 1 of sokolov2019, whose proof is not printed there."""
    k, steps, (place, gimbals, _) = sp.Symbol("k", positive=True), proof_steps(), PRINTED[paper]
    symbolic, numeric = decide(papers_m1(paper)), decide(papers_m1(paper, numbers=True))
    plvcc = [decide(m1) for m1 in (sp.Symbol("J1", positive=True), sp.exp(2 * k * q2), sp.cosh(k * q2) ** 2)]
    # d = 0 with a constant b: the appendix takes its Psi for singular.
    trivial = sp.Matrix([[0, 1], [1, 0]])
    is_solution = all(is_skew(B(i, trivial, sp.eye(2))) for i in range(2))
    on_printed_proof = (
        "The printed proof has a gap: d = 0 alone does not make Psi singular (m1 = 1, Psi = [[0, 1], [1, 0]]). The "
        "same argument for c, from B_(1), closes the gap: m1 (m1'/m1)' not constant makes both c and d zero. The "
        "equality of the mixed derivatives is printed with a wrong sign: it is m1 (m1'/m1)' d = +2 d''. By (2) the "
        "factor before (J1 + J2 cos^2 q2)/(I_c + I_d) is 1, not 2, since both gimbals turn; the conclusion is the same "
        "for any factor."
    )
    return Claim(
        place,
        "No full-rank Psi(q) makes B_(1) and B_(2) skew-symmetric: the system is not partially linearisable "
        "via coordinate changes.",
        holds=all(steps.values())
        and symbolic.Psi is None
        and numeric.Psi is None
        and all(check.Psi is not None for check in plvcc),
        conditions=on_printed_proof if paper == "aranovskiy2020" else "",
        figures={
            "steps": steps,
            "papers_m1": symbolic.figures,
            "table_numbers": numeric.figures,
            "counter_checks": [c.figures | {"Psi": str(c.Psi.tolist())} for c in plvcc if c.Psi is not None],
            "d_zero_alone_is_singular": not (is_solution and trivial.det() != 0),
            "factor_of_m1_by_the_equations": inertia_factor(gimbals),
            "factor_of_m1_printed": gimbals,
        },
    )
