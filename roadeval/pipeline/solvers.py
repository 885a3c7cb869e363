"""What scikit-learn solves: two problems of optimisation, here or in a process of its own."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.runtime import processes as apart
from roadeval.runtime.processes import Arrays

Floats = npt.NDArray[np.float64]

LIBRARY: Final = "sklearn.svm"


def support_vectors(
    features: Floats, road: npt.NDArray[np.bool_], c: float, kernel: str, gamma: float
) -> Arrays:
    """Solve the dual of a soft margin (Eq. 14) with libsvm.

    Parameters
    ----------
    features, road
        ``(n, 3)`` float64 and ``(n,)`` bool.
    c, kernel, gamma
        As in `roadeval.pipeline.paper.svm.SvmSettings`.

    Returns
    -------
    dict
        ``vectors`` ``(m, 3)``, ``weights`` ``(m,)`` and ``offset`` ``()``, all float64.
    """
    from sklearn.svm import SVC

    machine = SVC(C=float(c), kernel=str(kernel), gamma=float(gamma)).fit(features, road)
    return {
        "vectors": np.ascontiguousarray(machine.support_vectors_),
        "weights": np.ascontiguousarray(machine.dual_coef_[0]),
        "offset": machine.intercept_[0],
    }


def hyperplane(features: npt.NDArray[np.float32], road: npt.NDArray[np.bool_], c: float) -> Arrays:
    """Solve the primal of a linear machine with a squared hinge loss, with liblinear.

    Parameters
    ----------
    features, road, c
        ``(n, k)`` float32, ``(n,)`` bool, and the penalty.

    Returns
    -------
    dict
        ``weights`` ``(k,)`` and ``offset`` ``()``, both float64.
    """
    from sklearn.svm import LinearSVC

    machine = LinearSVC(C=float(c), dual=False).fit(features, road)
    return {"weights": machine.coef_[0], "offset": machine.intercept_[0]}


if __name__ == "__main__":
    apart.serve(LIBRARY, support_vectors, hyperplane)
