"""Derivatives by extrapolation of central differences, independent of any differentiation of expressions."""

import numpy as np

HALVINGS = 6


def slope(function, first=0.05):
    """d function(h)/dh at 0 of an array-valued function: Richardson's extrapolation of central differences.

    The entry of the tableau with the smallest change to its neighbours is taken, as beyond it rounding grows (C.
    Ridders, Adv. Eng. Software 4, 1982).
    """
    step, rows, best, error = first, [], None, None
    for _ in range(HALVINGS):
        row = [(function(step) - function(-step)) / (2.0 * step)]
        for k, before in enumerate(rows[-1] if rows else ()):
            row.append(row[k] + (row[k] - before) / (4.0 ** (k + 1) - 1.0))
            change = np.maximum(np.abs(row[-1] - row[k]), np.abs(row[-1] - before))
            if best is None:
                best, error = row[-1].copy(), change
            better = change < error
            best, error = np.where(better, row[-1], best), np.where(better, change, error)
        rows.append(row)
        step *= 0.5
    return best
