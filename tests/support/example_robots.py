"""The robots of example-robot-data, and their inverse dynamics by Pinocchio with mimicking joints gathered."""

import numpy as np
import pinocchio as pin

from bellcrank.robot.catalog import names

REFUSED = {
    "alex_psyonic_hands.urdf": "mimic",  # mimics joints that the file does not have
    "ur3.urdf": "",  # an empty shell: no joints that move
}


def example_robots():
    """Each URDF of example-robot-data once, by the shortest of its names."""
    shortest = {}
    for name, path in sorted(names().items(), key=lambda item: len(item[0])):
        shortest.setdefault(path, name)
    return sorted((name, path.name) for path, name in shortest.items())


SOUND = [name for name, file in example_robots() if file not in REFUSED]


def gathered(robot, model, data, q, v, a):
    """RNEA with every joint free, mimicking ones driven by hand, torques gathered on their leaders."""
    matrix, offset = np.zeros((model.nv, robot.nv)), np.zeros(model.nv)
    ratios = {f: (leader, m, o) for f, leader, m, o in robot.mimics()}
    for j in range(1, model.njoints):
        name, m, o = model.names[j], 1.0, 0.0
        while name in ratios:
            name, ratio, shift = ratios[name]
            o, m = o + m * shift, m * ratio
        matrix[model.idx_vs[j], robot.joint(name).v] = m
        offset[model.idx_vs[j]] = o
    rows = zip(q @ matrix.T + offset, v @ matrix.T, a @ matrix.T, strict=True)
    return np.array([pin.rnea(model, data, *row) for row in rows]) @ matrix
