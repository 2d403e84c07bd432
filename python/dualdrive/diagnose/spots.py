"""Where along the travel a local fault sits: where what is left has a bump of the angle.

A worn tooth shifts a flank while its place is in mesh, so that every series shows a bump there,
each of its own size and sign. Centres along the travel and a few widths are tried.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.orders import STANDS_OUT, angle_of, travel_of

Array = NDArray[np.float64]

_CENTRES, _WIDTHS = 25, (0.06, 0.15, 0.35)  # along the travel; of it
TRIED = _CENTRES * len(_WIDTHS)


def worst_spot(evidence: Evidence, rest: Array, place: str) -> tuple[float, float] | None:
    """Centre and width, rad at the place, of the bump that explains most of the whitened rest.

    Args:
        evidence: the confrontation and its noise.
        rest: whitened rows with the nuisances' share removed, shape (n,).
        place: motor_1, pinion_2, table, ...

    Returns:
        None where the place has no recorded angle, or nothing stands out.

    """
    c, parts = evidence.confrontation, evidence.apart(rest)
    reach = travel_of(c, place)
    if reach is None or reach[1] <= reach[0]:
        return None
    low, travel = reach[0], reach[1] - reach[0]
    centres = low + travel * (np.arange(_CENTRES) + 0.5) / _CENTRES
    gains = np.zeros((len(_WIDTHS), _CENTRES))
    for record, (white, own) in enumerate(zip(evidence.whiteners, parts, strict=True)):
        angle = angle_of(c.core, c.columns(record), place)
        if angle is None:
            continue
        for k, width in enumerate(_WIDTHS):
            off = (angle[:, None] - centres) / (width * travel)
            bumps = white(np.exp(-0.5 * off**2))
            size = np.einsum("ij,ij->j", bumps, bumps)
            gains[k] += np.where(size > 0.0, (own @ bumps) ** 2 / np.maximum(size, 1e-300), 0.0)
    widest, where = divmod(int(np.argmax(gains)), _CENTRES)
    if gains[widest, where] < STANDS_OUT:
        return None
    return float(centres[where]), float(_WIDTHS[widest] * travel)
