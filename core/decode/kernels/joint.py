"""All periods of an axis fitted together: their waves stand on the same light, through the same gain.

Where a response bends waves of few steps, the phase of a period alone is nearly flat at some places, and says little
there. But then the mean of the steps and the amplitude change with the phase, and how much light there is at all is
known from the other periods, or from white and black. Three steps with a power law of 2.2 come so to the noise of a
straight response.
"""

from __future__ import annotations

from core.decode.kernels.compiled import HALF, INT, ONE, TINY, F, part

TOLERANCE = F(0.005)  # part of the gain by which mean and amplitude may differ from the model without noise
FIELDS = F(0.02)  # part of the light of white and black by which that of the fringes may differ
MOST = F(0.125)  # turns: a change by more is none of noise
SIGMAS = F(5)  # nor one by so many standard deviations of the phase before


@part
def join(  # type: ignore[no-untyped-def]
    table, limits, count, turns, variance, means, amplitudes, threshold, contrast, known
):
    """Sharpen the phases (turns) of all periods by what their means and amplitudes tell, and their variances.

    Unknown are ambient light b, gain s and the phases: mean = b + s m(phase), amplitude = s r(phase), and the phase as
    measured. The phases are eliminated. `known` says that threshold and contrast are those of white and black.
    """
    joint, bend = table.joint, table.bend
    if len(joint) == 0:
        return
    periods, grid = len(joint), joint.shape[2]
    for i in range(count):
        light, parts = F(0), TINY
        for j in range(periods):
            at = _place(turns[j, i], grid)
            light += amplitudes[j, i]
            parts += joint[j, 1, at]
        gain = light / parts
        slack = TOLERANCE * TOLERANCE * gain * gain
        slack += limits.misfit * gain * gain
        bb, bs, ss, rb, rs = F(0), F(0), F(0), F(0), F(0)
        if known:
            spread = _variance(limits, threshold[i], HALF * gain) + FIELDS * FIELDS * gain * gain
            weight, low, high = ONE / spread, threshold[i] - contrast[i], threshold[i] + contrast[i]
            bb, bs, ss, rb, rs = F(2) * weight, weight, weight, weight * (low + high), weight * high
        for j in range(periods):
            at = _place(turns[j, i], grid)
            m, r, wm, wa, g1, g2, d = _weights(table, j, at, limits, means[j, i], amplitudes[j, i], gain, slack)
            w11, w12, w22 = wm - g1 * g1 / d, -g1 * g2 / d, wa - g2 * g2 / d
            one, two = w11 * means[j, i] + w12 * amplitudes[j, i], w12 * means[j, i] + w22 * amplitudes[j, i]
            bb += w11
            bs += w11 * m + w12 * r
            ss += w11 * m * m + F(2) * w12 * m * r + w22 * r * r
            rb += one
            rs += m * one + r * two
        det = bb * ss - bs * bs
        if not det > F(1e-6) * bb * ss:
            continue
        qbb, qbs, qss = ss / det, -bs / det, bb / det
        b, s = qbb * rb + qbs * rs, qbs * rb + qss * rs
        for j in range(periods):
            at = _place(turns[j, i], grid)
            m, r, _, _, g1, g2, d = _weights(table, j, at, limits, means[j, i], amplitudes[j, i], gain, slack)
            shift = (g1 * (means[j, i] - b - s * m) + g2 * (amplitudes[j, i] - s * r)) / d
            h1, h2 = g1 / d, (g1 * m + g2 * r) / d
            var = ONE / d + h1 * h1 * qbb + F(2) * h1 * h2 * qbs + h2 * h2 * qss + bend[j, 0, at + 1, 3]
            if abs(shift) < MOST and shift * shift < SIGMAS * SIGMAS * variance[j, i] and var < variance[j, i]:
                turns[j, i] += shift
                variance[j, i] = var


@part
def _weights(table, j, at, limits, mean, amplitude, gain, slack):  # type: ignore[no-untyped-def]
    """Mean and amplitude by unit gain, their weights, these times how both change over the phase; its own weight."""
    of = table.joint
    m, r, m1, r1, t1 = of[j, 0, at], of[j, 1, at], of[j, 2, at], of[j, 3, at], of[j, 4, at]
    noise, cofactor = _variance(limits, mean, amplitude), table.covariance[j, 0]
    across = ONE / (noise * cofactor + TINY)
    wm, wa = ONE / (noise * table.mean_cofactor[j] + slack), ONE / (noise * cofactor + slack)
    d = gain * gain * (m1 * m1 * wm + r1 * r1 * wa + t1 * t1 * across) + TINY
    return m, r, wm, wa, gain * m1 * wm, gain * r1 * wa, d


@part
def _variance(limits, level, modulation):  # type: ignore[no-untyped-def]
    """Variance of a grey value: noise and misfit."""
    return max(limits.dark + limits.shot * level, limits.floor) + limits.misfit * modulation * modulation


@part
def _place(turns, grid):  # type: ignore[no-untyped-def]
    """Where the tables have a phase, which straightening may have carried beyond half a turn."""
    whole = ONE if turns >= HALF else (-ONE if turns < -HALF else F(0))
    return min(max(INT((turns - whole + HALF) * F(grid)), 0), grid - 1)
