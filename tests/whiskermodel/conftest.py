"""An independent beam for the tests of the dynamic model."""

import numpy as np
import pytest
from scipy.special import roots_legendre


class FiniteElementBeam:
    """Cubic Hermite elements and Newmark's rule; knows nothing of modes."""

    def __init__(self, whisker, n_elements=48, node=None):
        self.whisker, self.n = whisker, n_elements
        share = np.linspace(0, 1, n_elements + 1)
        self.x = whisker.length * (1 - (1 - share) ** 1.5)  # finer towards the tip
        if node is not None:
            self.x[np.argmin(np.abs(self.x - node))] = node
        size = 2 * n_elements + 2
        self.stiffness, self.mass = np.zeros((size, size)), np.zeros((size, size))
        nodes, weights = roots_legendre(6)
        z, w = (nodes + 1) / 2, weights / 2
        for e in range(n_elements):
            h = self.x[e + 1] - self.x[e]
            s = self.x[e] + h * z
            cross = whisker.radius(s) ** 2 * np.pi * whisker.density
            shape, bent = self.hermite(z, h), self.hermite_bent(z, h)
            at = slice(2 * e, 2 * e + 4)
            self.stiffness[at, at] += (bent * (w * h * whisker.flexural_rigidity(s))) @ bent.T
            self.mass[at, at] += (shape * (w * h * cross)) @ shape.T

    @staticmethod
    def hermite(z, h):
        rows = [1 - 3 * z**2 + 2 * z**3, h * (z - 2 * z**2 + z**3)]
        return np.stack([*rows, 3 * z**2 - 2 * z**3, h * (z**3 - z**2)])

    @staticmethod
    def hermite_bent(z, h):
        rows = [(12 * z - 6) / h**2, (6 * z - 4) / h]
        return np.stack([*rows, (6 - 12 * z) / h**2, (6 * z - 2) / h])

    def point_load(self, c):
        e = min(np.searchsorted(self.x, c, side="right") - 1, self.n - 1)
        h = self.x[e + 1] - self.x[e]
        load = np.zeros(len(self.mass))
        load[2 * e : 2 * e + 4] = self.hermite((c - self.x[e]) / h, h)
        return load

    def run(self, c, force, dt, angle=None, spring=None, held_until=0):
        """Base moment, base shear, base angle and tip displacement from rest, each (time,).

        The base is held at zero and turned by `angle` (time,), or on a `spring` [N m/rad]. Up to
        sample `held_until` the node at c is held at zero too; the force then has no effect.
        """
        stiffness = self.stiffness.copy()
        if spring is not None:
            stiffness[1, 1] += spring
        damping = 2 * self.whisker.damping_rate * self.mass
        given = np.zeros((3, len(force), len(self.mass)))  # u, v, a of what is prescribed
        if angle is not None:
            given[0, :, 1] = angle
            given[1] = np.gradient(given[0], dt, axis=0, edge_order=2)
            given[2] = np.gradient(given[1], dt, axis=0, edge_order=2)
        load = -np.outer(force, self.point_load(c))
        base = [0, 1] if spring is None else [0]
        support = 2 * int(np.argmin(np.abs(self.x - c)))
        effective = self.mass + dt / 2 * damping + dt**2 / 4 * stiffness
        u = v = a = np.zeros(len(self.mass))
        out = np.zeros((4, len(force)))
        free, inverse = None, None
        for j in range(1, len(force)):
            if free is None or j == held_until + 1:
                fixed = base + [support] * (j <= held_until)
                free = np.setdiff1d(np.arange(len(self.mass)), fixed)
                inverse = np.linalg.inv(effective[np.ix_(free, free)])
            u, v = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
            a = given[2, j].copy()
            u[fixed], v[fixed] = given[0, j, fixed], given[1, j, fixed]
            right = load[j] - stiffness @ u - damping @ v - self.mass @ a
            a[free] = inverse @ right[free]
            u[free] += dt**2 / 4 * a[free]
            v[free] += dt / 2 * a[free]
            inner = self.stiffness[:2] @ u + damping[:2] @ v + self.mass[:2] @ a
            out[:, j] = [-(inner - load[j, :2])[1], (inner - load[j, :2])[0], u[1], u[-2]]
        if spring is not None:
            out[0] = spring * out[2]
        return out


@pytest.fixture(scope="session")
def finite_element_beam():
    return FiniteElementBeam
