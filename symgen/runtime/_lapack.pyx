# cython: language_level=3
"""Routines of LAPACK, by the addresses that SciPy publishes: nothing is linked at build time."""

from cpython.pycapsule cimport PyCapsule_GetName, PyCapsule_GetPointer

from scipy.linalg import cython_lapack


cdef void *address(str name) except NULL:
    capsule = cython_lapack.__pyx_capi__[name]
    return PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule))


gbtrf = <gbtrf_t>address("dgbtrf")
gbtrs = <gbtrs_t>address("dgbtrs")
