"""Motion between sampled points: what a plan or a command asks for at any time."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def interpolate_motion(
    times: Array, positions: Array, velocities: Array | None, time: float
) -> tuple[Array, Array]:
    """
    Return position and velocity between points, at rest before the first and after the last.

    Parameters
    ----------
    times
        Of the points, ascending, shape (m,) [s].
    positions
        Shape (m, n) [rad].
    velocities
        Shape (m, n) [rad/s]; without them the points are joined by straight lines.
    time
        On the same axis as the points' [s].

    Returns
    -------
    tuple of Array
        Position [rad] and velocity [rad/s], shape (n,); by cubic Hermite interpolation if there
        are velocities.

    """
    # By hand: scipy's spline costs ten times as much per call, and 0.3 s at the first import.
    after = int(times.searchsorted(time, side='right'))
    if after == 0 or after == times.size:
        return positions[max(after - 1, 0)], np.zeros(positions.shape[1])
    step = float(times[after] - times[after - 1])
    s = (time - float(times[after - 1])) / step
    start, end = positions[after - 1], positions[after]
    chord = (end - start) / step
    if velocities is None:
        return start + s * (end - start), chord
    # Deviation from the chord, in the end slopes' differences to it.
    first, last = velocities[after - 1] - chord, velocities[after] - chord
    r = 1.0 - s
    position = start + s * (end - start) + step * s * r * (r * first - s * last)
    velocity = chord + r * (1.0 - 3 * s) * first + s * (1.0 - 3 * r) * last
    return position, velocity
