# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The rigid motion that elastic links move about: a driven linkage at any time, followed along its branch."""

import numpy as np

from libc.math cimport ceil, fabs
from libc.string cimport memcpy

from symgen.runtime._core cimport _DONE, Equations, kernel_of


cdef class RigidMotion:
    """A linkage whose drives leave nothing free, with the kernels of elastic links along its motion.

    Parameters
    ----------
    equations
        The rigid linkage.
    motion, joints
        Addresses of the kernels of ``elastic_motion`` and of ``elastic_joints``.
    sizes
        Sizes of what the kernels links, joints, torque and loads write.
    t, y
        A time and the state there.
    stride
        The longest time [s] over which a state is a good guess of the next.
    """

    def __init__(self, Equations equations, motion, joints, sizes, double t, y, double stride):
        self.equations = equations
        self.links, self.joints = kernel_of(motion, "links"), kernel_of(joints, "joints")
        self.torque, self.point_loads = kernel_of(motion, "torque"), kernel_of(motion, "loads")
        self.count = sizes[0] // MOTION
        self.motion, self.joined, self.turning, self.loads = (np.zeros(size + 1) for size in sizes)
        self.still = np.zeros(len(y) + equations.n + equations.m + 1)
        self.y, self.began = np.array([*y, 0.0]), np.array([*y, 0.0])
        self.t, self.began_at, self.stride, self.solved = t, t, stride, False

    cdef int at(self, double t) noexcept nogil:
        """Move to a time and evaluate all kernels there; return a status of the core."""
        cdef Py_ssize_t k, steps
        cdef double start
        cdef int status = _DONE
        cdef double *q = &self.y[0]
        cdef double *u = q + self.equations.n
        if fabs(t - self.began_at) < fabs(t - self.t):
            memcpy(q, &self.began[0], self.began.shape[0] * sizeof(double))
            self.t, self.solved = self.began_at, False
        start = self.t
        steps = <Py_ssize_t>ceil(fabs(t - start) / self.stride)
        for k in range(1, steps):
            status = self._moved(start + (t - start) * k / steps)
            if status != _DONE:
                return status
        status = self._moved(t)
        if status != _DONE:
            return status
        self.links(&self.t, q, u, &self.equations.p[0], &self.equations.out[0], &self.motion[0])
        self.joints(&self.t, q, u, &self.equations.p[0], &self.equations.out[0], &self.joined[0])
        if self.torque != NULL:
            self.torque(&self.t, q, u, &self.equations.p[0], &self.equations.out[0], &self.turning[0])
        if self.point_loads != NULL:
            self.point_loads(&self.t, q, u, &self.equations.p[0], &self.equations.out[0], &self.loads[0])
        return _DONE

    cdef int at_rest(self, double t) noexcept nogil:
        """Evaluate the kernels in the pose of a time as if nothing moved and nothing loaded the linkage."""
        cdef Py_ssize_t i, k
        cdef int status = self.at(t)
        if status != _DONE:
            return status
        for k in range(self.count):
            for i in range(2, MOTION):
                self.motion[MOTION * k + i] = 0.0
        self.loads[:] = 0.0
        self.joints(&self.t, &self.y[0], &self.still[0], &self.equations.p[0], &self.still[0], &self.joined[0])
        return _DONE

    cdef int _moved(self, double t) noexcept nogil:
        """Take the state to a time near by; leave accelerations and multipliers in the equations' ``out``."""
        cdef Py_ssize_t i, n = self.equations.n
        cdef double h = t - self.t
        cdef int status
        cdef double *y = &self.y[0]
        if h == 0.0 and self.solved:
            return _DONE
        if h != 0.0:
            if not self.solved:
                self.equations.accelerate(self.t, y)
            for i in range(n):
                y[i] += h * (y[n + i] + h / 2 * self.equations.out[i])
                y[n + i] += h * self.equations.out[i]
        self.solved = False
        status = self.equations.project(t, y)
        if status != _DONE:
            return status
        self.t = t
        self.equations.accelerate(t, y)
        self.solved = True
        return _DONE

    def evaluate(self, double t):
        """Return status, state, motion of links, what the joints kernel wrote, torque and loads at a time."""
        cdef int status = self.at(t)
        found = [np.array(self.y), np.array(self.motion), np.array(self.joined), np.array(self.turning),
                 np.array(self.loads)]
        return status, *(values[:len(values) - 1] for values in found)

    def along(self, double[::1] times):
        """Return a status, and states, motion of links and point loads at rising times, a row each."""
        cdef Py_ssize_t k, n = self.y.shape[0] - 1, m = self.motion.shape[0] - 1, loads = self.loads.shape[0] - 1
        cdef int status = _DONE
        found = [np.zeros((times.shape[0], size + 1)) for size in (n, m, loads)]
        cdef double[:, ::1] states = found[0], rows = found[1], forces = found[2]
        with nogil:
            for k in range(times.shape[0]):
                status = self.at(times[k])
                if status != _DONE:
                    break
                memcpy(&states[k, 0], &self.y[0], n * sizeof(double))
                memcpy(&rows[k, 0], &self.motion[0], m * sizeof(double))
                memcpy(&forces[k, 0], &self.loads[0], loads * sizeof(double))
        return status, found[0][:, :n], found[1][:, :m], found[2][:, :loads]

    def solution(self):
        """Return accelerations and multipliers where the motion is."""
        return np.array(<double[:self.equations.n + self.equations.m]>self.equations.out)
