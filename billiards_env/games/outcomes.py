"""Kernels that find the distinct outcomes of many shots."""

from __future__ import annotations

import numpy as np

from billiards_env.jit import allocating_entry_point, entry_point

CUE_BALL = 0
"""The ball that the engine strikes, as in `engine.shots`."""


@entry_point
def write_outcomes(centres, positions, potted, cushions, cushions_before_hit, first_hit, pockets, after):
    """Writes the pocket of each potted ball, and whether a cushion or a pocket was met after the cue ball's first hit.

    Args:
        centres: (p, 2) float64, the centres of the pockets, m.
        positions: (m, n, 2) float64, m, at the end. A potted ball is at the centre of its pocket.
        potted: (m, n) bool; all balls are on the table before the shots.
        cushions: (m, n) int32.
        cushions_before_hit: (m, n) int32.
        first_hit: (m,) int64.
        pockets: (m, n) int8 out; -1 for balls that the shot does not pot.
        after: (m,) bool out.
    """
    for k in range(len(first_hit)):
        first = first_hit[k]
        met = first >= 0 and cushions[k, CUE_BALL] > cushions_before_hit[k, first]
        for i in range(potted.shape[1]):
            pockets[k, i] = -1
            if potted[k, i]:
                nearest = np.inf
                for p in range(len(centres)):
                    away = abs(positions[k, i, 0] - centres[p, 0]) + abs(positions[k, i, 1] - centres[p, 1])
                    if away < nearest:
                        nearest, pockets[k, i] = away, p
            met = met or pockets[k, i] >= 0 or (i != CUE_BALL and cushions[k, i] > 0)
        after[k] = met and first >= 0


@allocating_entry_point
def group_rows(rows, group, examples):
    """Groups equal rows, in the order of their first row.

    Args:
        rows: (m, w) int8.
        group: (m,) int64 out, the group of each row.
        examples: (m,) int64 out, the first row of each group.

    Returns:
        The number of groups.
    """
    m, width = rows.shape
    size = 2
    while size < 2 * m:
        size *= 2
    slots = np.full(size, -1)  # a hash table: the group in each slot
    count = 0
    for k in range(m):
        slot = 0
        for c in range(width):
            slot = (31 * slot + rows[k, c]) & (2**40 - 1)
        slot = (slot ^ (slot >> 17)) & (size - 1)
        while slots[slot] >= 0 and not np.array_equal(rows[examples[slots[slot]]], rows[k]):
            slot = (slot + 1) & (size - 1)
        if slots[slot] < 0:
            slots[slot], examples[count] = count, k
            count += 1
        group[k] = slots[slot]
    return count
