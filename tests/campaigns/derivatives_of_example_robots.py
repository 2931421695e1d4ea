"""Derivatives of the dynamics of every robot of example-robot-data, on a fixed and a free base, by complex steps.

PYTHONPATH=tests/support python -m tests.campaigns.derivatives_of_example_robots --cases 162 --seed 1
"""

import argparse

import numpy as np
from complex_step import dynamics_derivatives, random_state
from example_robots import SOUND

import bellcrank as bc
from bellcrank.robot.dynamics.derivative_equations import DerivativeEquations

TOLERANCE = 1e-10  # of the largest entry of each matrix


def check(name, floating_base, seed=1):
    """Assert that the expressions themselves, which are compiled as they are, are the derivatives by complex steps."""
    robot = bc.load_robot(name, floating_base=floating_base)
    if not robot.nv:
        return
    equations = DerivativeEquations(robot.equations)
    q, v, a = random_state(robot, seed)

    def compared(algorithm, third):
        found = [np.array(x).reshape(robot.nv, robot.nv) for x in getattr(equations, algorithm)()(q, v, third)]
        for one, other in zip(found, dynamics_derivatives(robot, algorithm, q, v, third), strict=True):
            assert np.abs(one - other).max() <= TOLERANCE * np.abs(other).max(), (name, floating_base, algorithm)
        return found

    mass = compared("inverse_dynamics", a)[2]
    if np.linalg.cond(mass) <= 1e15:  # else massless grippers, or a massless link as free base
        compared("forward_dynamics", np.array(robot.equations.dynamics("inverse_dynamics")(q, v, a)).ravel())


def main():
    """Check that many of the robots and bases, in a random order."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2 * len(SOUND), help="robots and bases")
    parser.add_argument("--seed", type=int, default=1, help="of the order and of the states")
    given = parser.parse_args()
    cases = [(name, floating) for name in SOUND for floating in (False, True)]
    order = np.random.default_rng(given.seed).permutation(len(cases))[: given.cases]
    for k in order:
        check(*cases[k], given.seed)
    print(f"{len(order)} robots and bases: derivatives within {TOLERANCE:g} of complex steps")


if __name__ == "__main__":
    main()
