"""All angles of planar arms, in closed form: two joints that reach a point, three a pose."""

from __future__ import annotations

import numpy as np

from copose.poses import Array, Mask


def planar_angles(segments: Array, target: Array, angle: Array | None) -> tuple[Array, Mask]:
    """Turns of the joints of planar chains, both ways to bend the elbow, (count, 2, k).

    Args:
        segments: from each joint to the next, and from the last to the tip, all at zero, as complex
            numbers, (count, k): two joints, three where the angle counts.
        target: from the first joint to the goal of the tip, (count,).
        angle: of the tip, from that at zero, (count,); None where it is free.

    Returns:
        The turns, and where they exist.
    """
    if angle is not None:
        target = target - np.exp(1j * angle) * segments[:, 2]
    upper, fore = segments[:, 0], segments[:, 1]
    lengths = np.abs(upper) * np.abs(fore)
    with np.errstate(all="ignore"):
        cosine = (np.abs(target) ** 2 - np.abs(upper) ** 2 - np.abs(fore) ** 2) / (2 * lengths)
        bend = np.arccos(cosine)[:, None] * np.array([1.0, -1.0])
        second = bend + np.angle(upper / fore)[:, None]
        first = np.angle(target[:, None] / (upper[:, None] + np.exp(1j * second) * fore[:, None]))
    both = [first, second]
    if angle is not None:
        both.append(angle[:, None] - first - second)
    turned = np.stack(both, axis=-1)
    return np.nan_to_num(turned), np.isfinite(turned).all(axis=-1)
