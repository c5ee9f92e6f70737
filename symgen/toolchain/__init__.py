"""The C compiler, the cache of compiled kernels, and the dependencies of cache entries."""
