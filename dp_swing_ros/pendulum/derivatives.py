# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
First and second derivatives of the accelerations.

The accelerations a solve D a = r; differentiating that identity gives

    D ∂a = ∂r - ∂D a,    νᵀ D ∂²a = νᵀ (∂²r - ∂²D a - 2 ∂D ∂a)

by the five variables z = (θ1, θ2, θ̇1, θ̇2, f) that they depend on. A model evaluates them at the
points of all its steps first, several steps side by side in the lanes of a vector, and keeps
them; then it propagates them step by step, several directions of (x, u) side by side. So all is
scalars in and out, and no loop within a loop.
"""

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import sincos
from dp_swing_ros.pendulum.equations import generalised_force, inverse_inertia

KEPT = 27    # numbers of a point


@kernel
def jacobian(p, s_1, c_1, s_2, c_2, w_1, w_2, f):
    """
    Return the accelerations a, the three rows of J = ∂a/∂z = D⁻¹ (∂r/∂z - ∂D/∂z a), and more.

    Each row holds its derivatives by z = (θ1, θ2, θ̇1, θ̇2, f); the last is a column of D⁻¹, of
    which the other entries (11, 12, 22) come third.
    """
    i_00, i_01, i_02, i_11, i_12, i_22 = inverse_inertia(p, s_1, c_1, s_2, c_2)
    r_0, r_1, r_2 = generalised_force(p, s_1, c_1, s_2, c_2, w_1, w_2, f)
    a_0 = i_00 * r_0 + i_01 * r_1 + i_02 * r_2
    a_1 = i_01 * r_0 + i_11 * r_1 + i_12 * r_2
    a_2 = i_02 * r_0 + i_12 * r_1 + i_22 * r_2
    s_12, c_12 = s_1 * c_2 - c_1 * s_2, c_1 * c_2 + s_1 * s_2
    h_1, h_2, h_12 = p.d_01, p.d_02, p.d_12
    # ∂(r - D a)/∂z at fixed a, column by column
    q_0 = h_1 * (c_1 * w_1 * w_1 + s_1 * a_1)
    q_1 = h_1 * (p.g * c_1 + s_1 * a_0) + h_12 * (s_12 * a_2 - c_12 * w_2 * w_2)
    q_2 = h_12 * (c_12 * w_1 * w_1 + s_12 * a_1)
    t_0 = h_2 * (c_2 * w_2 * w_2 + s_2 * a_2)
    t_1 = h_12 * (c_12 * w_2 * w_2 - s_12 * a_2)
    t_2 = h_2 * (p.g * c_2 + s_2 * a_0) - q_2
    v_0, v_1, v_2 = 2 * h_1 * s_1 * w_1, -p.b_1 - p.b_2, 2 * h_12 * s_12 * w_1 + p.b_2
    y_0, y_1, y_2 = 2 * h_2 * s_2 * w_2, -2 * h_12 * s_12 * w_2 + p.b_2, -p.b_2
    return (a_0, a_1, a_2), (
        (i_00 * q_0 + i_01 * q_1 + i_02 * q_2, i_00 * t_0 + i_01 * t_1 + i_02 * t_2,
         i_00 * v_0 + i_01 * v_1 + i_02 * v_2, i_00 * y_0 + i_01 * y_1 + i_02 * y_2, i_00),
        (i_01 * q_0 + i_11 * q_1 + i_12 * q_2, i_01 * t_0 + i_11 * t_1 + i_12 * t_2,
         i_01 * v_0 + i_11 * v_1 + i_12 * v_2, i_01 * y_0 + i_11 * y_1 + i_12 * y_2, i_01),
        (i_02 * q_0 + i_12 * q_1 + i_22 * q_2, i_02 * t_0 + i_12 * t_1 + i_22 * t_2,
         i_02 * v_0 + i_12 * v_1 + i_22 * v_2, i_02 * y_0 + i_12 * y_1 + i_22 * y_2, i_02)), (
            i_11, i_12, i_22)


@kernel
def curvature(p, s_1, c_1, s_2, c_2, w_1, w_2, a, J, inverse, mu_0, mu_1, mu_2):
    """
    Return M = Σ μᵢ ∂²aᵢ/∂z², with a, J and entries of D⁻¹ from `jacobian` at the same point.

    Adjoint form: with ν = D⁻¹ μ, g(z) = νᵀ (r - D a) at fixed a, and e_j = ∂D/∂z_j ν,
    M_jk = ∂²g/∂z_j∂z_k - e_j·J_k - e_k·J_j. Only the angles have an e, so all else is zero but
    what is returned: M_00 to M_04, M_11 to M_14, M_22 and M_33.
    """
    (J_00, J_01, J_02, J_03, J_04), (J_10, J_11, J_12, J_13, J_14), (
        J_20, J_21, J_22, J_23, J_24) = J
    i_00, i_01, i_02, i_11, i_12, i_22 = J_04, J_14, J_24, inverse[0], inverse[1], inverse[2]
    a_0, a_1, a_2 = a
    n_0 = i_00 * mu_0 + i_01 * mu_1 + i_02 * mu_2
    n_1 = i_01 * mu_0 + i_11 * mu_1 + i_12 * mu_2
    n_2 = i_02 * mu_0 + i_12 * mu_1 + i_22 * mu_2
    s_12, c_12 = s_1 * c_2 - c_1 * s_2, c_1 * c_2 + s_1 * s_2
    h_1, h_2, h_12 = p.d_01, p.d_02, p.d_12

    towards_2 = n_1 * h_12 * (s_12 * w_2 * w_2 + c_12 * a_2)
    towards_1 = n_2 * h_12 * (c_12 * a_1 - s_12 * w_1 * w_1)
    g_00 = (n_0 * h_1 * (c_1 * a_1 - s_1 * w_1 * w_1) + n_1 * h_1 * (c_1 * a_0 - p.g * s_1)
            + towards_1 + towards_2)
    g_11 = (n_0 * h_2 * (c_2 * a_2 - s_2 * w_2 * w_2) + n_2 * h_2 * (c_2 * a_0 - p.g * s_2)
            + towards_1 + towards_2)
    g_02 = 2 * w_1 * (n_0 * h_1 * c_1 + n_2 * h_12 * c_12)
    g_03 = -2 * w_2 * n_1 * h_12 * c_12
    g_12 = -2 * w_1 * n_2 * h_12 * c_12
    g_13 = 2 * w_2 * (n_0 * h_2 * c_2 + n_1 * h_12 * c_12)
    g_22 = 2 * (n_0 * h_1 * s_1 + n_2 * h_12 * s_12)
    g_33 = 2 * (n_0 * h_2 * s_2 - n_1 * h_12 * s_12)

    e_00, e_10 = -h_1 * s_1 * n_1, -h_2 * s_2 * n_2
    e_01, e_11 = -h_1 * s_1 * n_0 - h_12 * s_12 * n_2, h_12 * s_12 * n_2
    e_02, e_12 = -h_12 * s_12 * n_1, h_12 * s_12 * n_1 - h_2 * s_2 * n_0
    return (g_00 - 2 * (e_00 * J_00 + e_01 * J_10 + e_02 * J_20),
            -towards_1 - towards_2 - (e_00 * J_01 + e_01 * J_11 + e_02 * J_21)
            - (e_10 * J_00 + e_11 * J_10 + e_12 * J_20),
            g_02 - (e_00 * J_02 + e_01 * J_12 + e_02 * J_22),
            g_03 - (e_00 * J_03 + e_01 * J_13 + e_02 * J_23),
            -(e_00 * J_04 + e_01 * J_14 + e_02 * J_24),
            g_11 - 2 * (e_10 * J_01 + e_11 * J_11 + e_12 * J_21),
            g_12 - (e_10 * J_02 + e_11 * J_12 + e_12 * J_22),
            g_13 - (e_10 * J_03 + e_11 * J_13 + e_12 * J_23),
            -(e_10 * J_04 + e_11 * J_14 + e_12 * J_24),
            g_22, g_33)


@kernel
def keep(p, th_1, th_2, v, w_1, w_2, u, out, i):
    """
    Write what the derivatives at a point need in lane i, and return the accelerations there.

    Shapes: out (KEPT, lanes).
    """
    s_1, c_1 = sincos(th_1)
    s_2, c_2 = sincos(th_2)
    a, J, inverse = jacobian(p, s_1, c_1, s_2, c_2, w_1, w_2, u - p.b_0 * v)
    out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i] = s_1, c_1, s_2, c_2, w_1, w_2
    out[6, i], out[7, i], out[8, i] = a
    out[9, i], out[10, i], out[11, i], out[12, i], out[13, i] = J[0]
    out[14, i], out[15, i], out[16, i], out[17, i], out[18, i] = J[1]
    out[19, i], out[20, i], out[21, i], out[22, i], out[23, i] = J[2]
    out[24, i], out[25, i], out[26, i] = inverse
    return a


@kernel
def kept_jacobian(kept, i):
    """Return J of the point in lane i, three rows of five."""
    return ((kept[9, i], kept[10, i], kept[11, i], kept[12, i], kept[13, i]),
            (kept[14, i], kept[15, i], kept[16, i], kept[17, i], kept[18, i]),
            (kept[19, i], kept[20, i], kept[21, i], kept[22, i], kept[23, i]))


@kernel
def kept_curvature(p, kept, i, J, mu_0, mu_1, mu_2):
    """Return M = Σ μᵢ ∂²aᵢ/∂z² of the point in lane i, as `curvature` does."""
    return curvature(p, kept[0, i], kept[1, i], kept[2, i], kept[3, i], kept[4, i], kept[5, i],
                     (kept[6, i], kept[7, i], kept[8, i]), J,
                     (kept[24, i], kept[25, i], kept[26, i]), mu_0, mu_1, mu_2)


@kernel
def along(J, z):
    """Return J z, the three accelerations' change in a direction."""
    (J_00, J_01, J_02, J_03, J_04), (J_10, J_11, J_12, J_13, J_14), (
        J_20, J_21, J_22, J_23, J_24) = J
    z_0, z_1, z_2, z_3, z_4 = z
    return (J_00 * z_0 + J_01 * z_1 + J_02 * z_2 + J_03 * z_3 + J_04 * z_4,
            J_10 * z_0 + J_11 * z_1 + J_12 * z_2 + J_13 * z_3 + J_14 * z_4,
            J_20 * z_0 + J_21 * z_1 + J_22 * z_2 + J_23 * z_3 + J_24 * z_4)


@kernel
def against(J, m_0, m_1, m_2):
    """Return Jᵀ m, five numbers."""
    (J_00, J_01, J_02, J_03, J_04), (J_10, J_11, J_12, J_13, J_14), (
        J_20, J_21, J_22, J_23, J_24) = J
    return (J_00 * m_0 + J_10 * m_1 + J_20 * m_2, J_01 * m_0 + J_11 * m_1 + J_21 * m_2,
            J_02 * m_0 + J_12 * m_1 + J_22 * m_2, J_03 * m_0 + J_13 * m_1 + J_23 * m_2,
            J_04 * m_0 + J_14 * m_1 + J_24 * m_2)


@kernel
def bent(M, z):
    """Return M z of the eleven numbers of `curvature`, five numbers."""
    M_00, M_01, M_02, M_03, M_04, M_11, M_12, M_13, M_14, M_22, M_33 = M
    z_0, z_1, z_2, z_3, z_4 = z
    return (M_00 * z_0 + M_01 * z_1 + M_02 * z_2 + M_03 * z_3 + M_04 * z_4,
            M_01 * z_0 + M_11 * z_1 + M_12 * z_2 + M_13 * z_3 + M_14 * z_4,
            M_02 * z_0 + M_12 * z_1 + M_22 * z_2,
            M_03 * z_0 + M_13 * z_1 + M_33 * z_3,
            M_04 * z_0 + M_14 * z_1)
