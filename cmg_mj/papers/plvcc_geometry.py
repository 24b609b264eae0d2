"""Is a mechanical system with M = diag(m1(q2), 1) partially linearisable via coordinate changes (PLvCC)?

The definition, by aranovskiy2020's appendix: a full-rank Psi(q) makes every B_(i) skew-symmetric. And the decision:

1. B_(i) + B_(i)' is the Lie derivative of the inverse of M along the column Psi_i. So B_(i) is skew-symmetric exactly
   if Psi_i is a Killing field of the metric M, whatever the other column is.
2. A Killing field (b, d) of diag(m1(q2), 1) has d = d(q1), and m1 (m1'/m1)' d = 2 d''. If d is not zero at some q1,
   then m1 (m1'/m1)' is a constant. If it is zero everywhere, for both columns, the second row of Psi is zero.
3. Where m1 (m1'/m1)' is a constant C, Psi = [[1, b], [0, d]] with d'' = C d/2 does it: the condition is sufficient
   too. det Psi = d. For C >= 0 it is nowhere zero; for C < 0 Psi has full rank on strips of q1 only. Constant C means
   m1 = f^2 with f'' = k f, and an f without zeros on the whole line has C >= 0.

`plvcc.py` checks these steps. sympy takes most of a second to import, so it is imported where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


class UndecidedError(ValueError):
    """Neither a Psi nor a contradiction was found."""


def coordinates() -> tuple[Any, Any]:
    """Return the symbols q1 (tilt) and q2 (gimbal angle)."""
    import sympy as sp

    return sp.symbols("q1 q2", real=True)


def bracket(X: Any, Y: Any) -> Any:
    """Return the Lie bracket [X, Y] = dY/dq X - dX/dq Y, as sokolov2019 prints it, (2, 1).

    aranovskiy2020 prints q_i and q_j for q, which gives no vector.
    """
    q = coordinates()
    return Y.jacobian(q) * X - X.jacobian(q) * Y


def B(i: int, Psi: Any, M: Any, point: Mapping[Any, Any] | None = None) -> Any:
    """Return B_(i), aranovskiy2020 appendix, (2, 2).

    Args:
        i: Number of the column of Psi, from 0.
        Psi: The change of velocities, (2, 2).
        M: The inertia matrix, (2, 2).
        point: Point to evaluate it at, coordinate -> value. Putting that in early keeps the expressions small.
    """
    import sympy as sp

    q = coordinates()

    def substitute(matrix: Any) -> Any:
        return matrix.subs(point) if point else matrix

    N = Psi.T * M * Psi
    first, second = substitute(M * Psi * Psi.T).inv(), substitute(N).inv()
    result = sp.zeros(2, 2)
    for j in range(2):
        result += substitute(bracket(Psi[:, i], Psi[:, j]) * Psi[:, j].T) * first
        derivative = -second * substitute(N.diff(q[j])) * second  # of the inverse of N
        result += sp.Rational(1, 2) * substitute(Psi[j, i] * Psi) * derivative * substitute(Psi.T)
    return result


def lie_derivative(X: Any, M: Any) -> Any:
    """Return the Lie derivative of the inverse of M along X, (2, 2): zero exactly if X is a Killing field of M."""
    import sympy as sp

    q = coordinates()
    inverse = M.inv()
    directional_derivative = sum((X[k] * inverse.diff(q[k]) for k in range(2)), sp.zeros(2, 2))
    return directional_derivative - X.jacobian(q) * inverse - inverse * X.jacobian(q).T


def vanishes(expression: Any) -> bool:
    """Return true if a quotient of polynomials in q, sines, cosines and exponentials is zero.

    sympy's simplify does this too, in minutes for some of the expressions here.
    """
    import sympy as sp
    from sympy.polys.fields import sfield

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
    return all(vanishes(entry) for entry in matrix + matrix.T)


def condition(m1: Any) -> Any:
    """Return m1 (m1'/m1)' = m1'' - m1'^2/m1, which by the paper's necessary condition is constant."""
    import sympy as sp

    q2 = coordinates()[1]
    return sp.diff(m1, q2, 2) - sp.diff(m1, q2) ** 2 / m1


def explicit_psi(m1: Any, C: Any) -> Any:
    """Return the Psi of step 3 for an m1 with m1 (m1'/m1)' = C, (2, 2)."""
    import sympy as sp

    q1, q2 = coordinates()
    slope = sp.diff(m1, q2) / m1
    if C.is_zero:
        return sp.Matrix([[1, -q1 * slope / 2], [0, 1]])
    rate = sp.sqrt(abs(C) / 2)
    d = sp.exp(rate * q1) if C.is_positive else sp.cos(rate * q1)
    return sp.Matrix([[1, -sp.diff(d, q1) * slope / C], [0, d]])


@dataclass(frozen=True)
class Decision:
    """The decision whether M = diag(m1(q2), 1) is PLvCC.

    Attributes:
        plvcc: Whether it is.
        m1: The inertia decided on.
        Psi: One that does it; None if there is none.
        everywhere: Whether Psi has full rank for all q1, at every q2 at which m1 > 0.
        values: m1 (m1'/m1)' by q2: one value if it is constant, two that differ if it is not.
    """

    plvcc: bool
    m1: Any
    Psi: Any
    everywhere: bool
    values: Mapping[Any, Any]


def decide(m1: Any) -> Decision:
    """Decide whether M = diag(m1(q2), 1) is partially linearisable via coordinate changes.

    Args:
        m1: An expression in q2. Other symbols stand for any value that keeps it positive.

    Returns:
        The decision. A yes comes with a Psi, whose B_(i) were found skew-symmetric by substitution in the definition;
        a no with two angles at which m1 (m1'/m1)' is not the same.

    Raises:
        UndecidedError: m1 (m1'/m1)' is not seen to be constant and not seen to change, or the sign of its constant
            depends on a symbol.
    """
    import sympy as sp

    q2 = coordinates()[1]
    value = condition(m1)
    values = {
        angle: sp.factor(value.subs(q2, angle))
        for angle in (sp.Integer(0), sp.pi / 2, sp.pi / 4, sp.Integer(1))
        if not vanishes(m1.subs(q2, angle))
    }
    angle, C = next(iter(values.items()))
    if not vanishes(sp.diff(value, q2)):
        for other_angle, other_value in values.items():
            difference = sp.factor(other_value - C)
            if difference.is_zero is False or (difference.free_symbols and not vanishes(difference)):
                return Decision(False, m1, None, False, {angle: C, other_angle: other_value})
        raise UndecidedError(f"m1 = {m1}: m1 (m1'/m1)' = {value} was not seen to be constant, nor to change")
    if not (C.is_zero or C.is_positive or C.is_negative):
        raise UndecidedError(f"m1 = {m1}: the sign of {C} depends on its symbols; say which of them are positive")
    Psi = explicit_psi(m1, C)
    if not all(is_skew(B(i, Psi, sp.diag(m1, 1))) for i in range(2)):
        raise UndecidedError(f"m1 = {m1}: the B_(i) of Psi = {Psi} were not seen to be skew-symmetric")
    return Decision(True, m1, Psi, not C.is_negative, {angle: C})
