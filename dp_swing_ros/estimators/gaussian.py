# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Mean z = (x, p) and covariance P of state and unknowns: prediction, correction, bounds.

    z⁻ = (φ(x, p), p)    P⁻ = F P Fᵀ + Q    y = x + ẋ ε + noise
    z = z⁻ + K (y - x⁻)    P = (I - K H) P⁻ (I - K H)ᵀ + K R Kᵀ

φ is the motion of pendulum and drive from one measurement to the next, and F its Jacobian, by
differences of whole motions: whatever φ is, they are right. All of a state is measured at one
time, which a stamp tells but to an error ε: at 10 rad/s a millisecond is 10 mrad. Source: Simon,
Optimal State Estimation, 2006, 13.2 and 13.4; covariances by Joseph's form.
"""

import math

import numpy as np

from dp_swing_ros.estimators.unknowns import drive_of, model_of, turn, write_values
from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.drive import follow_commands
from dp_swing_ros.pendulum.model import size


@kernel
def product(left, right, out):
    """
    Write left @ right; at this size a call of the linear algebra costs more.

    Shapes: left (a, n), right (n, b), out (a, b).
    """
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(left.shape[1]):
                total += left[i, j] * right[j, k]
            out[i, k] = total


@kernel
def symmetrise(P):
    """Replace P by (P + Pᵀ) / 2."""
    for i in range(len(P)):
        for j in range(i):
            P[i, j] = P[j, i] = (P[i, j] + P[j, i]) / 2


@kernel
def forget(prior, share, P):
    """Let the unknowns become as uncertain as at first, by a share; prior (m,) variances."""
    first = len(P) - len(prior)
    for i in range(len(prior)):
        P[first + i, first + i] += max(prior[i] - P[first + i, first + i], 0.0) * share


@kernel
def move(model, constants, nominal, factors, ends, commands, duration, z, b):
    """Advance the state in z in place by a time [s]; shapes: as of predict, b (m,) is written."""
    n = size(model)
    write_values(nominal, factors, z[n:], b)
    turn(b, -1.0, z[:n])
    follow_commands(model_of(model, b, constants), drive_of(b), ends, commands, z[:n], duration)
    turn(b, 1.0, z[:n])


@kernel
def predict(model, constants, nominal, factors, ends, commands, duration, differences,
            force_noise, acceleration_noise, z, P):
    """
    Advance mean and covariance in place by a time [s]; return ẋ at its end.

    The noises are densities, squared; differences are those for derivatives, the last of time.
    Shapes: differences (2n + 3 + m,), acceleration_noise (n + 1,), constants and nominal as of
    Unknowns, ends and commands as of follow_commands, z (2n + 2 + m,),
    P (2n + 2 + m, 2n + 2 + m), ẋ (2n + 2,).
    """
    n, k, shortly = size(model), len(z), min(differences[-1], duration)
    b, F, FP = np.empty(len(nominal)), np.empty((n, k)), np.empty((n, k))   # the rows of x alone
    # from z moved by each of its numbers, from z for a shorter time, and from z, the last first
    ends_of = np.empty((k + 2, k))
    for j in range(k + 1, -1, -1):
        if n <= j < k - 1 and P[j, j] == 0.0:   # what is certain moves nothing
            for i in range(k):
                ends_of[j, i] = ends_of[k + 1, i]
            continue
        for i in range(k):
            ends_of[j, i] = z[i] + (differences[j] if i == j else 0.0)
        move(model, constants, nominal, factors, ends, commands,
             duration - (shortly if j == k else 0.0), ends_of[j], b)
    mean, rate = ends_of[k + 1], np.empty(n)
    for i in range(n):
        for j in range(k):
            F[i, j] = (ends_of[j, i] - mean[i]) / differences[j]
    product(F, P, FP)
    for i in range(n):
        z[i], rate[i] = mean[i], (mean[i] - ends_of[k, i]) / shortly
        for j in range(n, k):
            P[i, j] = P[j, i] = FP[i, j]
    product(FP, F.T, P[:n, :n])
    for i in range(n):
        for j in range(n):   # the last of p is a force
            P[i, j] += force_noise / duration * F[i, k - 1] * F[j, k - 1]
    # apart from the sums, for no compiler may round a product and its sum at once
    of_speeds = acceleration_noise * duration
    of_both = acceleration_noise * duration ** 2 / 2
    of_positions = acceleration_noise * duration ** 3 / 3
    for x in range(n // 2):
        v = n // 2 + x
        P[v, v] += of_speeds[x]
        P[x, v] += of_both[x]
        P[v, x] += of_both[x]
        P[x, x] += of_positions[x]
    symmetrise(P)
    return rate


@kernel
def correct(measured, R, rate, time_noise, z, P):
    """
    Correct mean and covariance in place, one measured number after the other; NaN is none.

    Returns how far each was from what those before it let expect: the innovation over its standard
    deviation, which is white where the model is right. Shapes: measured and R (2n + 2,), the
    variances of its noise; rate (2n + 2,), ẋ; time_noise the variance of ε [s²]; z (k,), P (k, k).
    """
    k = len(z)
    whitened, gain, row = np.zeros(len(measured)), np.empty(k + 1), np.empty(k + 1)
    mean, A = np.zeros(k + 1), np.zeros((k + 1, k + 1))   # of (z, ε)
    A[k, k] = time_noise
    for a in range(k):   # a slice at once would take long to compile
        mean[a] = z[a]
        for b in range(k):
            A[a, b] = P[a, b]
    for i in range(len(measured)):
        if math.isnan(measured[i]):
            continue
        for a in range(k + 1):
            row[a] = A[i, a] + rate[i] * A[k, a]
        innovation = measured[i] - mean[i] - rate[i] * mean[k]
        S = row[i] + rate[i] * row[k] + R[i]
        # rounding may leave P without its sign: then nothing is believed
        whitened[i] = innovation / math.sqrt(S) if S > 0 else math.nan
        for a in range(k + 1):
            gain[a] = row[a] / S
            mean[a] += innovation * gain[a]
        # (I - k h) A (I - k h)ᵀ + k r kᵀ
        for a in range(k + 1):
            for b in range(k + 1):
                A[a, b] -= gain[a] * row[b]
            column = R[i] * gain[a] - A[a, i] - rate[i] * A[a, k]
            for b in range(k + 1):
                A[a, b] += column * gain[b]
    for a in range(k):
        z[a] = mean[a]
        for b in range(k):
            P[a, b] = A[a, b]
    symmetrise(P)
    return whitened


@kernel
def constrain(lowest, highest, z, P):
    """
    Bring p within its bounds in place, and along with it what it is correlated with.

    Clipped alone, p would leave the others with values that fit what it no longer is. Source:
    Simon, 7.5.2 (projection of the estimate, weighted by P⁻¹). Shapes: lowest and highest (m,).
    """
    first = len(z) - len(lowest)
    for i in range(len(lowest)):
        j = first + i
        beyond = z[j] - min(max(z[j], lowest[i]), highest[i])
        if beyond != 0 and P[j, j] > 0:
            share = beyond / P[j, j]
            for a in range(len(z)):
                z[a] -= P[a, j] * share
    for i in range(len(lowest)):
        z[first + i] = min(max(z[first + i], lowest[i]), highest[i])
