"""Small initial value problems as kernels of the integrator, beside SciPy's solve_ivp."""

from dataclasses import fields

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from bellcrank import _step
from bellcrank.codegen.compile import compiled
from bellcrank.elements.signals import Signal
from bellcrank.simulation.integration.integration_problem import (
    EventSearch,
    IntegrationProblem,
    Kernels,
    StateLayout,
    StepControl,
)

METHODS = ("RK4", "RK45", "DOP853", "Radau")
NONE = np.empty(0)


class Problem:
    """x' = f(t, x, u, p) as kernels of the integrator's interface."""

    def __init__(self, name, slope, x0, t1, inputs=0, parameters=(), events=None):
        self.x0, self.t1, self.p = np.array(x0, float), float(t1), np.array(parameters, float)
        n = len(self.x0)
        t, x, dx = ca.SX.sym("t"), ca.SX.sym("x", n), ca.SX.sym("dx", n)
        u, p = ca.SX.sym("u", inputs), ca.SX.sym("p", len(self.p))
        f = ca.vertcat(*slope(t, x, u, p))

        def kernel(suffix, arguments, result):
            function = ca.Function(name + suffix, arguments, [ca.densify(result)])
            return compiled(name + suffix, [str(function)], lambda: function)

        self.slope = kernel("", [t, x, u, p], f)
        self.jacobian = kernel("_jacobian", [t, x, u, p], ca.vec(ca.densify(ca.jacobian(f, x))))
        self.tangent = kernel("_tangent", [t, x, u, p, dx], ca.jtimes(f, x, dx))
        self.events = kernel("_events", [t, x, u, p], ca.vertcat(*events(t, x, u, p))) if events else None

    def run(self, method, tolerance=1e-6, **changes):
        """Integrate a problem with these changes."""
        changes = {k: np.asarray(v, float) if k in ("times", "stops", "x0") else v for k, v in changes.items()}
        progress = changes.pop("progress", None)
        return _step.PreparedProblem(self.problem(method, tolerance, **changes)).run(progress)

    def problem(self, method, tolerance=1e-6, **changes):
        """The record; `changes` are attributes of it or its parts, signals as tuples of a Signal's fields."""
        values = {
            "rhs": self.slope.address("scalar"), "method": method, "t1": self.t1, "x0": self.x0, "parameters": self.p,
            "norm_size": len(self.x0), "rtol": tolerance, "atol": tolerance, "lanes": 8, "max_evaluations": 10**9,
            "jacobian": self.jacobian.address("scalar"), "event_functions": 0,
        }  # fmt: skip
        if self.events:
            count = self.events.output_sizes[0]
            values |= {
                "event_functions": self.events.address("scalar"),
                "terminal": [False] * count,
                "direction": [0] * count,
            }
        if method == "RK4" and "step" not in changes:
            changes["step"] = 0.01
        values |= changes
        if "signals" in values:
            values["signals"] = [Signal(*signal) for signal in values["signals"]]

        def part(kind, **more):
            names = {field.name for field in fields(kind)} & values.keys()
            return kind(**{name: values.pop(name) for name in names}, **more)

        problem = part(
            IntegrationProblem,
            kernels=part(Kernels, events=values.pop("event_functions")),
            layout=part(StateLayout),
            control=part(StepControl),
            events=part(EventSearch),
        )
        assert not values, f"no attributes of a problem: {', '.join(values)}"
        return problem

    def scipy(self, method, tolerance, **more):
        n = len(self.x0)
        more = {"rtol": tolerance, "atol": tolerance} | more
        if method == "Radau":
            more["jac"] = lambda t, x: self.jacobian([t], x, NONE, self.p).reshape(n, n).T
        return solve_ivp(lambda t, x: self.slope([t], x, NONE, self.p), (0, self.t1), self.x0, method=method, **more)
