"""Swing the planar 2R arm up with weak motors: IPOPT on the arm's equations; writes planar_2r_swing_up.html.

Direct collocation by Hermite and Simpson (M. Kelly, An Introduction to Trajectory Optimization, SIAM Review 59, 2017,
section 4): the equations of motion hold at both ends and in the middle of each interval. casadi differentiates them.
"""

import casadi
import numpy as np

import bellcrank as bc

DURATION, INTERVALS = 5.0, 60  # s
HANGING, UPRIGHT = (-np.pi / 2, 0.0), (np.pi / 2, 0.0)
LIMIT = np.array([100.0, 50.0])  # N m; to hold both links level takes 288 N m at the shoulder


def swing_up(arm: bc.Robot) -> tuple[np.ndarray, ...]:
    """Times (n,), and positions, velocities, accelerations and torques (n, 2) of little torque and change of torque."""
    points, step = 2 * INTERVALS + 1, DURATION / INTERVALS
    problem = casadi.Opti()
    q, v, tau = (problem.variable(2, points) for _ in range(3))
    a = arm.casadi("forward_dynamics").map(points)(q, v, tau)
    left, middle, right = slice(0, points - 2, 2), slice(1, points, 2), slice(2, points, 2)
    for x, rate in ((q, v), (v, a)):
        difference = step / 8 * (rate[:, left] - rate[:, right])
        problem.subject_to(x[:, middle] == (x[:, left] + x[:, right]) / 2 + difference)
        mean = (rate[:, left] + 4 * rate[:, middle] + rate[:, right]) / 6
        problem.subject_to(x[:, right] == x[:, left] + step * mean)
    problem.subject_to(tau[:, middle] == (tau[:, left] + tau[:, right]) / 2)
    problem.subject_to(q[:, 0] == HANGING)
    problem.subject_to(q[:, -1] == UPRIGHT)
    problem.subject_to(v[:, [0, -1]] == 0)
    for x, low, high in ((q, arm.lower, arm.upper), (v, -arm.velocity_limit, arm.velocity_limit), (tau, -LIMIT, LIMIT)):
        problem.subject_to(problem.bounded(np.tile(low[:, None], points), x, np.tile(high[:, None], points)))
    square = casadi.sum1((tau / LIMIT) ** 2)
    change = casadi.sumsqr((tau[:, right] - tau[:, left]) / LIMIT) / step
    mean_square = (square[left] + 4 * square[middle] + square[right]) / 6
    problem.minimize(step * casadi.sum2(mean_square) + 0.01 * change)
    share = np.linspace(0.0, 1.0, points)
    turn = HANGING[0] + (UPRIGHT[0] - HANGING[0]) * share
    problem.set_initial(q, np.array([turn, 0.3 * np.sin(2 * np.pi * share)]))
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    found = problem.solve()
    rows = [found.value(x).T for x in (q, v, a, tau)]
    return (np.linspace(0.0, DURATION, points), *rows)


def main() -> None:
    arm = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
    time, q, v, a, tau = swing_up(arm)
    motion = bc.Motion(arm.joints, time, q, v, a, name="swing up")
    between = time[:-1] + 0.5 * np.diff(time)
    linear = np.array([np.interp(between, time, torque) for torque in tau.T]).T
    error = np.abs(arm.inverse_dynamics(*motion.at(between)) - linear).max()
    print(f"swung up in {DURATION:g} s with at most {np.abs(tau).max(axis=0).round(1)} N m")
    print(f"between the points the equations hold to {error:.2f} N m")
    print(bc.replay(motion, "planar_2r_swing_up.html", robot=arm, trace=("tip",)))
    assert (np.abs(tau) <= LIMIT * (1 + 1e-6)).all()
    assert np.abs(arm.inverse_dynamics(q, v, a) - tau).max() < 1e-6
    assert error < 1.0


if __name__ == "__main__":
    main()
