"""How many threads numerical libraries may use in a process that a benchmark starts."""

from __future__ import annotations

from collections.abc import Mapping

#: Sums over several threads round differently: with one, results do not depend on the machine.
ONE_THREAD: Mapping[str, str] = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB")
}
