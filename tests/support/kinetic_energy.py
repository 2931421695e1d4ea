"""Kinetic energy by Pinocchio's inverse dynamics, and that of the traced expression."""

import numpy as np
import pinocchio as pin
from example_robots import gathered


def rotors(of, random):
    """A random rotor on each joint of one degree of freedom."""
    return {j.name: float(random.uniform(0.05, 2.0)) for j in of.joints if j.nv == 1}


def half_v_m_v(of, q, v):
    """By Pinocchio's recursive Newton-Euler in doubles: M v is what the torque becomes more with an acceleration v."""
    model, data, rest = of.model, of.model.createData(), np.zeros_like(v)
    if model.nv == of.nv:
        momenta = [
            pin.rnea(model, data, *s) - pin.rnea(model, data, s[0], s[1], s[1]) for s in zip(q, rest, v, strict=True)
        ]
    else:
        momenta = gathered(of, model, data, q, rest, v) - gathered(of, model, data, q, rest, rest)
    return 0.5 * np.einsum("ni,ni->n", v, np.array(momenta))


def traced_energy(of, q, v):
    """The traced expression, not compiled: kinetic energy (n,)."""
    return np.array(of.equations.algorithm("energy")(q.T, v.T, []))[0]
