"""Random damage to sound files, and the tables of the benchmark."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import hostile
from benchmarks.hostile import HostileConfig
from tests.hostile.mutations import mutation, sound_objects

GOOD = {"simulated", "typed error", "needs CoACD"}


def test_a_seed_and_a_number_give_one_mutation() -> None:
    assert [mutation(3, n) for n in range(40)] == [mutation(3, n) for n in range(40)]
    assert mutation(3, 0) != mutation(4, 0)
    names = {mutation(3, n)[0] for n in range(200)}
    assert names == set(sound_objects())


def test_mutations_do_no_harm(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF mutations need mujoco")
    config = HostileConfig(corpus=False, mutations=150, seed=1, out=tmp_path)
    (table,) = hostile.report(config)
    result = json.loads((tmp_path / "hostile.json").read_text())
    assert result["mutations"]["bad"] == []
    assert sum(result["mutations"]["counts"].values()) == 150
    assert set(result["mutations"]["counts"]) <= GOOD
    assert table.row_count >= 5


def test_a_crash_costs_only_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mutation that ends its process is found among its neighbours and counted."""
    config = HostileConfig(mutations=4, first=10)
    asked = []

    def workers(tasks, config, description):
        del config, description
        asked.append([(t.first, t.count) for t in tasks])
        alive = [t for t in tasks if t.count == 1 and t.first != 12]
        found = [
            {
                "number": t.first,
                "object": "urdf",
                "outcome": "typed error",
                "message": "",
                "seconds": 0.1,
                "cpu": 9.0 if t.first == 11 else 0.1,
            }
            for t in alive
        ]
        return found, [t for t in tasks if t not in alive]

    monkeypatch.setattr(hostile, "_in_workers", workers)
    records = hostile.run_mutations(config)
    assert asked == [[(10, 4)], [(10, 1), (11, 1), (12, 1), (13, 1)]]
    assert [r["outcome"] for r in records] == ["typed error", "hang", "crash", "typed error"]


def test_the_corpus_table_counts_each_kind() -> None:
    ours = {"outcome": "typed error", "seconds": 0.25, "outside": 0, "message": ""}
    theirs = {"outcome": "crash", "outside": 1, "message": ""}
    records = [
        {"name": "a", "kind": "urdf", "what": "", "ours": ours, "simulator": theirs},
        {"name": "b", "kind": "mjcf", "what": "", "ours": {**ours, "outcome": "loads"}},
    ]
    console = Console(width=180, record=True)
    console.print(hostile.corpus_table(records))
    lines = [line.split() for line in console.export_text().splitlines()]
    numbers = [[word for word in line if word[0].isalnum()] for line in lines if "│" in line]
    assert ["all", "artgym", "2", "1", "1", "0", "0", "0", "0", "0", "0.25"] in numbers
    assert ["urdf", "SAPIEN", "1", "0", "0", "0", "0", "1", "0", "1"] in numbers
