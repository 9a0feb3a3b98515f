"""How many threads numerical libraries may use in a process that is started here."""

from __future__ import annotations

from collections.abc import Mapping

#: Sums over several threads round differently: with one, results do not depend on the machine.
ONE_THREAD: Mapping[str, str] = {
    f"{name}_THREADS": "1"
    for name in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "BLIS_NUM", "NUMBA_NUM", "VECLIB_MAXIMUM")
}
