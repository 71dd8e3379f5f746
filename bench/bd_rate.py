"""BD-rate: mean difference of rate at equal quality, by monotone cubics over the logarithm of the rate."""

import math
from bisect import bisect_right

# Number of qualities at which two curves are compared.
PLACES = 2001


def curve(points):
    """Returns qualities and logarithms of the rate, both ascending, from points (rate, quality)."""
    points = sorted((quality, math.log(rate)) for rate, quality in points if math.isfinite(quality))
    rising = [(a, b) for a, b in zip(points, points[1:]) if b[0] > a[0] + 1e-4 and b[1] > a[1]]
    return list(zip(*points[:1] + [after for _, after in rising]))


def slopes(x, y):
    """Returns the slopes of Fritsch and Carlson's monotone cubic."""
    h = [b - a for a, b in zip(x, x[1:])]
    d = [(b - a) / step for a, b, step in zip(y, y[1:], h)]
    inner = []
    for i in range(1, len(x) - 1):
        a, b = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
        inner.append((a + b) / (a / d[i - 1] + b / d[i]) if d[i - 1] * d[i] > 0 else 0.0)
    return [d[0], *inner, d[-1]]


def values(x, y, places):
    """Yields the monotone cubic through (x, y) at some positions."""
    m = slopes(x, y)
    for place in places:
        i = min(max(bisect_right(x, place) - 1, 0), len(x) - 2)
        h, t = x[i + 1] - x[i], (place - x[i]) / (x[i + 1] - x[i])
        left = y[i] * (1 + 2 * t) * (1 - t) ** 2 + h * m[i] * t * (1 - t) ** 2
        yield left + y[i + 1] * t * t * (3 - 2 * t) + h * m[i + 1] * t * t * (t - 1)


def bd_rate(anchor, test):
    """Returns the mean difference of rate of `test` to `anchor` at equal quality [%]; NaN if the curves do not overlap."""
    curves = [curve(points) for points in (anchor, test)]
    if len(test) < 3 or any(len(one) < 2 or len(one[0]) < 2 for one in curves):
        return math.nan
    (qa, ra), (qt, rt) = curves
    low, high = max(qa[0], qt[0]), min(qa[-1], qt[-1])
    if high <= low:
        return math.nan
    places = [low + (high - low) * i / (PLACES - 1) for i in range(PLACES)]
    difference = [b - a for a, b in zip(values(qa, ra, places), values(qt, rt, places))]
    # Trapezoidal rule.
    mean = (sum(difference) - (difference[0] + difference[-1]) / 2) / (PLACES - 1)
    return 100 * (math.exp(mean) - 1)
