"""The library of the loops in ``c``, an empty module; see `roadeval.kernels.compiled`."""
