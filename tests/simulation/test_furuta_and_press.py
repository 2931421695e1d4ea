"""The Furuta pendulum and the crank press against their equations of motion in fewest coordinates, written by hand.

Between two switches (regions, limits, rows of the table) scipy integrates the equations of one side. Each switch is
located, and the integration goes on from there on the other side.
"""

import numpy as np
from scipy.integrate import solve_ivp

import bellcrank as bc

G = 9.81


def in_pieces(rate, functions, start, rows):
    """States at `rows` of x' = rate(x, sides); the sides are the signs of functions(x, sides)."""

    def settled(x, sides, fixed=None):
        for _ in range(3):  # a function may depend on the side of another one
            ahead = x + 1e-9 * rate(x, sides)  # beyond its zero
            found = np.sign(functions(ahead, sides))
            if fixed is not None:
                found[fixed] = sides[fixed]
            sides = found
        return sides

    t, x, found = 0.0, np.asarray(start, dtype=float), {}
    sides = settled(x, np.ones(len(functions(x, None))))
    while True:
        events = []
        for k, side in enumerate(sides):
            events.append(lambda _, y, k=k, sides=sides: functions(y, sides)[k])
            events[-1].terminal, events[-1].direction = True, -side
        later = [row for row in rows if row >= t]
        out = solve_ivp(
            lambda _, y, sides=sides: rate(y, sides), (t, rows[-1]), x, "DOP853", t_eval=later, events=events,
            rtol=1e-13, atol=1e-14,
        )  # fmt: skip
        found |= dict(zip(out.t, np.transpose(out.y), strict=True)) if len(out.t) else {}
        if out.status == 0:
            return np.array([found[row] for row in rows])
        which = next(k for k, times in enumerate(out.t_events) if len(times))
        t, x = float(out.t_events[which][0]), out.y_events[which][0]
        turned = sides.copy()
        turned[which] = -turned[which]
        sides = settled(x, turned, which)


def test_the_furuta_pendulum_is_swung_up_and_held_as_its_equations_have_it():
    """Lagrange's equations of arm φ and rod θ (0: down), as B. S. Cazzolato and Z. Prime, J. Control Science and
    Engineering 2011, 528341, derive them: the inertias of a rod about its joint and along itself, and its coupling."""
    r, half, m, axial = 0.085, 0.0645, 0.024, 1e-7
    about = 3.3282e-5 + m * half * half
    arm = 5.71979167e-5 + 0.095 * 0.0425**2 + m * r * r
    gain, top, pumping = [-0.0447214, 0.448885, -0.0195302, 0.0419023], 0.8, 5.0

    def torque(x, sides):
        phi, theta, dphi, dtheta = x
        if sides is None or sides[0] > 0:
            energy = 6.6564e-5 * dtheta**2 - 0.0151858 * np.cos(theta)
            return -pumping * (0.0151858 - energy) * dtheta * np.cos(theta), 0.03
        error = np.arctan2(-np.sin(theta), -np.cos(theta))
        return -np.dot(gain, [phi, error, dphi, dtheta]), 0.06

    def functions(x, sides):
        u, limit = torque(x, sides)
        return np.array([top + np.cos(x[1]), limit - u, limit + u])

    def rate(x, sides):
        _, theta, dphi, dtheta = x
        u, limit = torque(x, sides)
        u = limit if sides[1] < 0 else -limit if sides[2] < 0 else u
        s, c = np.sin(theta), np.cos(theta)
        mass = [[arm + about * s * s + axial * c * c, m * r * half * c], [m * r * half * c, about]]
        right = [
            u - 0.0005 * dphi - 2 * (about - axial) * s * c * dtheta * dphi + m * r * half * s * dtheta**2,
            (about - axial) * s * c * dphi**2 - m * G * half * s - 0.00005 * dtheta,
        ]
        return np.array([dphi, dtheta, *np.linalg.solve(mass, right)])

    times = np.linspace(0.0, 4.0, 81).tolist()
    expected = in_pieces(rate, functions, [0.0, np.deg2rad(5.0), 0.0, 0.0], times)
    run = bc.simulate("furuta", rtol=1e-11, atol=1e-11, times=times)
    span = np.ptp(expected, axis=0)
    assert (np.abs(run.state[:, :4] - expected).max(axis=0) < 1e-9 * span).all()


def test_the_press_turns_and_forms_as_its_equation_of_the_crank_has_it():
    """M(φ) φ'' + M'(φ) φ'²/2 + V'(φ) = τ + F y'(φ) with the ram at y = r sin φ − √(L² − r² cos² φ)."""
    r, length = 0.1, 0.5
    heights = np.array([0.0, 0.002, 0.006, 0.012, 0.015])
    forces = np.array([60e3, 90e3, 80e3, 30e3, 0.0])
    share = 0.15 / length  # of the rod's centre along it

    def places(phi):
        """Crank pin, ram, rod's centre and angle; analytic, so that complex steps differentiate them."""
        x, z = r * np.cos(phi), r * np.sin(phi)
        y = z - np.sqrt(length**2 - x * x)
        return y, (1 - share) * x, (1 - share) * z + share * y, np.arcsin(x / length)

    def slopes(phi):
        """First and second derivatives by φ, by hand."""
        x, z = r * np.cos(phi), r * np.sin(phi)
        root = np.sqrt(length**2 - x * x)
        y1 = x - x * z / root
        y2 = -z - ((x * x - z * z) / root - (x * z) ** 2 / root**3)
        first = np.array([y1, -(1 - share) * z, (1 - share) * x + share * y1, -z / root])
        second = np.array([y2, -(1 - share) * x, -(1 - share) * z + share * y2, -x / root + x * z * z / root**3])
        return first, second

    def drive(x):
        return 800.0 * (6.28 - x[1])

    def functions(x, sides):
        y = places(x[0])[0]
        down = -slopes(x[0])[0][0] * x[1]
        return np.array([down, 2000.0 - drive(x), 2000.0 + drive(x), *(y + r + length - heights[1:])])

    def rate(x, sides):
        phi, speed = x
        u = 2000.0 if sides[1] < 0 else -2000.0 if sides[2] < 0 else drive(x)
        height = places(phi)[0] + r + length
        piece = int((sides[3:] > 0).sum())
        force = 0.0
        if sides[0] > 0 and piece < 4:
            slope = (forces[piece + 1] - forces[piece]) / (heights[piece + 1] - heights[piece])
            force = forces[piece] + slope * (height - heights[piece])
        first, second = slopes(phi)
        weights = np.array([120.0, 30.0, 30.0, 0.6])
        mass = 40.0 + weights @ first**2
        change = 2.0 * weights @ (first * second)
        gravity = G * (120.0 * first[0] + 30.0 * first[2])
        return np.array([speed, (u + force * first[0] - gravity - 0.5 * change * speed**2) / mass])

    for phi in (0.3, 2.0, 4.0):  # the derivatives by hand are those of complex steps
        by_step = np.array([value.imag for value in places(phi + 1e-30j)]) / 1e-30
        assert np.abs(slopes(phi)[0] - by_step).max() < 1e-15

    times = np.linspace(0.0, 3.0, 61).tolist()
    expected = in_pieces(rate, functions, [np.pi / 2, 6.0], times)
    run = bc.simulate("press", rtol=1e-11, atol=1e-11, times=times)
    crank = run.joint("crank")
    found = np.stack([crank.position, crank.velocity], axis=1)
    assert (np.abs(found - expected).max(axis=0) < 1e-9 * np.ptp(expected, axis=0)).all()
