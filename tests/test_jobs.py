"""Shards of work: equal bytes, resuming, and what happens when processes die."""

from __future__ import annotations

import errno
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from artgym import files, jobs
from artgym.errors import (
    DamagedFileError,
    FileNotWrittenError,
    InvalidArgumentError,
    MissingDependencyError,
    UnknownNameError,
)
from artgym.files import MANIFEST_NAME, Manifest, read_arrays, write_arrays
from artgym.jobs import MAX_DEATHS, ShardsFailedError, ShardTask, run_shards

CONFIG = {"seed": 3}


def needs(module):
    missing = importlib.util.find_spec(module) is None
    return pytest.mark.skipif(missing, reason=f"{module} is missing: pip install 'artgym[cluster]'")


#: A run long enough to be interrupted; arguments: folder, workers.
DEMO = """
import signal, sys, time
import numpy as np
from artgym.files import write_arrays
from artgym.jobs import ShardTask, run_shards

# A shell that runs its jobs in the background has them ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)

def make(seed):
    time.sleep(0.01)
    return {"values": np.random.default_rng(seed).normal(size=8_000)}

tasks = [ShardTask(f"{seed:03d}.h5", seed) for seed in range(60)]
run_shards(tasks, make, sys.argv[1], config={}, write=write_arrays, workers=int(sys.argv[2]))
"""

#: Workers that fail once each, and a shard that never ends; arguments: folder, engine.
FAULTY = """
import ctypes, os, signal, sys, time
from pathlib import Path
import numpy as np
from artgym.jobs import ShardsFailedError, ShardTask, run_shards

folder = Path(sys.argv[1])

FAULTS = {
    1: lambda: os.kill(os.getpid(), signal.SIGKILL),
    2: lambda: os.kill(os.getpid(), signal.SIGSTOP),
    3: lambda: ctypes.string_at(0),
}

def make(seed):
    scar = folder.parent / f"{seed}.scar"
    if seed in FAULTS and not scar.exists():
        scar.touch()
        FAULTS[seed]()
    while seed == 4:
        pass
    return {"values": np.random.default_rng(seed).normal(size=(500, 3)), "seed": np.array(seed)}

def main():
    tasks = [ShardTask(f"{seed:03d}.h5", seed) for seed in range(8)]
    options = {"config": {"seed": 3}, "backend": sys.argv[2], "timeout": 5.0, "progress": False}
    try:
        run_shards(tasks, make, folder, workers=2, **options)
    except ShardsFailedError as error:
        sys.exit(str(error))

if __name__ == "__main__":
    main()
"""

ENGINES = [
    "loky",
    pytest.param("dask", marks=needs("distributed")),
    pytest.param("ray", marks=needs("ray")),
]


def make_arrays(seed):
    return {"values": np.random.default_rng(seed).normal(size=(500, 3)), "seed": np.array(seed)}


def tasks_for(seeds):
    return [ShardTask(f"{seed:03d}.h5", seed) for seed in seeds]


def run(folder, make=make_arrays, seeds=range(6), **options):
    options = {"config": CONFIG, "write": write_arrays, "progress": False, **options}
    return run_shards(tasks_for(seeds), make, folder, **options)


def folder_bytes(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


class TestResult:
    def test_bytes_do_not_depend_on_the_workers(self, tmp_path):
        manifest = run(tmp_path / "one")
        assert manifest.is_complete
        assert manifest.num_items == 12
        assert run(tmp_path / "more", workers=3) == manifest
        assert folder_bytes(tmp_path / "one") == folder_bytes(tmp_path / "more")

    def test_only_missing_and_damaged_shards_are_made(self, tmp_path):
        before = folder_bytes(run(tmp_path) and tmp_path)
        (tmp_path / "001.h5").write_bytes(before["001.h5"][:-5])
        flipped = bytearray(before["002.h5"])
        flipped[-1] ^= 1
        (tmp_path / "002.h5").write_bytes(flipped)
        (tmp_path / "003.h5").unlink()
        (tmp_path / ".artgym-004.h5.1-ab.tmp").write_bytes(b"left by a killed run")
        made = []
        run(tmp_path, lambda seed: made.append(seed) or make_arrays(seed))
        assert made == [1, 2, 3]
        assert folder_bytes(tmp_path) == before

    def test_a_folder_can_grow(self, tmp_path):
        run(tmp_path / "a", seeds=range(3))
        run(tmp_path / "a")
        run(tmp_path / "b")
        assert folder_bytes(tmp_path / "a") == folder_bytes(tmp_path / "b")

    def test_bar_goes_to_stderr(self, tmp_path, capsys):
        run(tmp_path, progress=True, description="annotating")
        out, err = capsys.readouterr()
        assert out == ""
        assert "annotating: 100%" in err
        assert "6/6" in err


class TestRefusals:
    def test_other_configuration(self, tmp_path):
        run(tmp_path)
        before = folder_bytes(tmp_path)
        with pytest.raises(InvalidArgumentError, match=r"config\.seed is 3 in the folder, 4 asked"):
            run(tmp_path, config={"seed": 4})
        assert folder_bytes(tmp_path) == before

    def test_foreign_shards_and_files(self, tmp_path):
        run(tmp_path)
        with pytest.raises(InvalidArgumentError, match=r"not among the tasks, such as '005\.h5'"):
            run(tmp_path, seeds=range(5))
        (tmp_path / MANIFEST_NAME).unlink()
        with pytest.raises(InvalidArgumentError, match=r"holds '000\.h5' but no manifest\.json"):
            run(tmp_path)

    def test_damaged_manifest(self, tmp_path):
        (tmp_path / MANIFEST_NAME).write_text("not JSON")
        with pytest.raises(DamagedFileError, match=r"manifest\.json is damaged"):
            run(tmp_path)

    @pytest.mark.parametrize("name", ["", "a/b.h5", "../x.h5", ".hidden", MANIFEST_NAME])
    def test_names(self, tmp_path, name):
        with pytest.raises(InvalidArgumentError, match="shard name"):
            run_shards([ShardTask(name, 0)], make_arrays, tmp_path, config={})

    def test_twice_the_same_name_and_no_workers(self, tmp_path):
        with pytest.raises(InvalidArgumentError, match=r"'000\.h5' occurs 2 times"):
            run(tmp_path, seeds=[0, 0])
        with pytest.raises(InvalidArgumentError, match="workers=0"):
            run(tmp_path, workers=0)

    @pytest.mark.parametrize("timeout", [0, -1.0, float("nan")])
    def test_no_time(self, tmp_path, timeout):
        with pytest.raises(InvalidArgumentError, match=r"timeout=.*expected seconds above 0"):
            run(tmp_path, timeout=timeout)

    def test_unknown_engine(self, tmp_path):
        with pytest.raises(UnknownNameError, match=r"unknown backend 'lokky'\. Nearest: 'loky'"):
            run(tmp_path, backend="lokky")
        assert not folder_bytes(tmp_path)

    @pytest.mark.parametrize(("engine", "module"), [("dask", "distributed"), ("ray", "ray")])
    def test_an_engine_that_is_not_installed(self, tmp_path, monkeypatch, engine, module):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(MissingDependencyError, match=r"pip install 'artgym\[cluster\]'"):
            run(tmp_path, backend=engine)

    def test_manifest_of_another_version(self, tmp_path):
        run(tmp_path)
        content = json.loads((tmp_path / MANIFEST_NAME).read_text())
        (tmp_path / MANIFEST_NAME).write_text(json.dumps({**content, "schema_version": 9}))
        before = folder_bytes(tmp_path)
        with pytest.raises(InvalidArgumentError, match=r"manifest\.json has schema version 9"):
            run(tmp_path)
        assert folder_bytes(tmp_path) == before


class TestFailures:
    @pytest.mark.parametrize("workers", [1, 2])
    def test_a_shard_that_raises_is_set_aside(self, tmp_path, workers):
        def make(seed):
            if seed == 2:
                raise ValueError("no such lamp")
            return make_arrays(seed)

        with pytest.raises(ShardsFailedError, match=r"002\.h5: ValueError: no such lamp \(.*:\d+"):
            run(tmp_path, make, workers=workers)
        manifest = Manifest.read(tmp_path)
        assert len(manifest.shards) == 5
        assert not manifest.is_complete
        assert run(tmp_path).is_complete

    def test_full_disk_ends_the_run_and_keeps_what_is_there(self, tmp_path, monkeypatch):
        replace, calls = os.replace, []

        def refuse_later(source, target):
            calls.append(target)
            if len(calls) > 5:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            replace(source, target)

        monkeypatch.setattr(files.os, "replace", refuse_later)
        with pytest.raises(FileNotWrittenError, match=r"cannot write .*\.h5: No space left"):
            run(tmp_path)
        monkeypatch.undo()
        assert len(Manifest.read(tmp_path).shards) == 2
        assert run(tmp_path).is_complete

    @pytest.mark.parametrize("workers", [1, 2])
    def test_a_small_disk(self, tmp_path, small_disk, workers):
        folder = small_disk / "shards"
        with pytest.raises(FileNotWrittenError, match=r"cannot write .*/shards/.*: No space left"):
            run(folder, seeds=range(20), workers=workers)
        made = Manifest.read(folder).shards
        assert 2 <= len(made) < 20
        assert [each.damage(folder) for each in made] == [None] * len(made)
        for path in folder.glob("*.h5"):
            read_arrays(path)
        assert not list(folder.glob(".artgym-*"))
        _mount("-o", "remount,size=2m", small_disk)
        assert run(folder, seeds=range(20)).is_complete
        run(tmp_path / "plain", seeds=range(20))
        assert folder_bytes(folder) == folder_bytes(tmp_path / "plain")

    def test_a_read_only_disk(self, small_disk):
        run(small_disk / "shards")
        (small_disk / "shards" / "003.h5").unlink()
        before = folder_bytes(small_disk / "shards")
        _mount("-o", "remount,ro", small_disk)
        with pytest.raises(
            FileNotWrittenError, match=r"manifest\.json: Read-only file system\. Ch"
        ):
            run(small_disk / "shards")
        assert folder_bytes(small_disk / "shards") == before

    def test_unwritable_folder(self, tmp_path):
        (tmp_path / "file").write_bytes(b"")
        with pytest.raises(FileNotWrittenError, match=r"file/sub/manifest\.json"):
            run(tmp_path / "file" / "sub")

    def test_one_thread_while_making(self, tmp_path):
        torch = pytest.importorskip("torch")
        before = torch.get_num_threads()
        torch.set_num_threads(2)
        try:
            run(tmp_path, lambda _: {"threads": np.array(torch.get_num_threads())}, seeds=[0])
            assert torch.get_num_threads() == 2
        finally:
            torch.set_num_threads(before)
        assert read_arrays(tmp_path / "000.h5")[0]["threads"] == 1


class TestDeaths:
    def test_a_killed_worker_costs_its_shard_only_once(self, tmp_path):
        marks = tmp_path / "marks"
        marks.mkdir()

        def make(seed):
            if seed == 1 and not (marks / "died").exists():
                (marks / "died").touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return make_arrays(seed)

        run(tmp_path / "killed", make, workers=2)
        run(tmp_path / "plain")
        assert folder_bytes(tmp_path / "killed") == folder_bytes(tmp_path / "plain")

    def test_a_shard_that_always_kills_is_set_aside(self, tmp_path):
        def make(seed):
            if seed == 1:
                os.kill(os.getpid(), signal.SIGKILL)
            return make_arrays(seed)

        with pytest.raises(ShardsFailedError, match=rf"001\.h5: .*died {MAX_DEATHS} times") as e:
            run(tmp_path, make, workers=2)
        assert "1 shards could not be made, 5 lie in" in str(e.value)
        names = [shard.name for shard in Manifest.read(tmp_path).shards]
        assert names == [f"{seed:03d}.h5" for seed in (0, 2, 3, 4, 5)]

    @pytest.mark.parametrize("engine", ENGINES)
    def test_workers_that_fail(self, tmp_path, engine):
        process = subprocess.run(
            [sys.executable, "-c", FAULTY, str(tmp_path / "faulty"), engine],
            cwd=Path(jobs.__file__).parents[1],
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            check=False,
        )
        assert "1 shards could not be made, 7 lie in" in process.stderr
        assert f"004.h5: its worker process took longer than timeout=5 s {MAX_DEATHS} times" in (
            process.stderr
        )
        assert len(list(tmp_path.glob("*.scar"))) == 3
        run(tmp_path / "faulty", seeds=range(8))
        run(tmp_path / "plain", seeds=range(8))
        assert folder_bytes(tmp_path / "faulty") == folder_bytes(tmp_path / "plain")

    def test_a_death_costs_only_its_shard(self, tmp_path):
        tries = tmp_path / "tries"
        tries.mkdir()

        def make(seed):
            (tries / f"{seed}-{time.time_ns()}").touch()
            if seed == 1:
                os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(0.2)
            return make_arrays(seed)

        with pytest.raises(ShardsFailedError):
            run(tmp_path / "shards", make, workers=2)
        names = sorted(tries.iterdir(), key=lambda path: path.name.partition("-")[2])
        seeds = [int(path.name.partition("-")[0]) for path in names]
        assert seeds.count(1) == MAX_DEATHS
        assert seeds[-1] == 1
        # A death costs nothing of what another worker was at.
        assert len(seeds) == 5 + MAX_DEATHS

    def test_one_worker_has_no_limit_of_time(self, tmp_path):
        def make(seed):
            time.sleep(0.02)
            return make_arrays(seed)

        assert run(tmp_path, make, timeout=0.01).is_complete

    def test_killed_at_any_moment_then_finished(self, tmp_path):
        rng = np.random.default_rng(0)
        folder = tmp_path / "killed"
        num_kills = 0
        for attempt in range(10):
            workers = "2" if attempt % 5 == 4 else "1"
            size_before = _num_shards(folder)
            with _demo(folder, workers) as process:
                while process.poll() is None and _num_shards(folder) <= size_before + 2:
                    time.sleep(0.002)
                time.sleep(rng.uniform(0, 0.1))
                process.kill()
                # The workers share this pipe: it ends when the last of them has followed.
                process.stderr.read()
            num_kills += process.returncode == -signal.SIGKILL
            for path in folder.glob("*.h5"):
                read_arrays(path)
            Manifest.read(folder)
        assert num_kills >= 5
        for path, workers in ((folder, "2"), (tmp_path / "plain", "1")):
            with _demo(path, workers) as process:
                assert process.wait(30) == 0
        assert folder_bytes(folder) == folder_bytes(tmp_path / "plain")

    def test_a_worker_ends_whose_parent_died_before_it_began(self):
        script = (
            "import time\nfrom artgym.engines import _follow_parent\n"
            "_follow_parent(1)\ntime.sleep(60)"
        )
        process = subprocess.run([sys.executable, "-c", script], timeout=30, check=False)
        assert process.returncode == 1

    @pytest.mark.parametrize("workers", ["1", "2"])
    def test_ctrl_c_leaves_a_resumable_folder(self, tmp_path, workers):
        with _demo(tmp_path, workers) as process:
            # Workers write shards, and the manifest lists them when it hears of it.
            while (
                not (tmp_path / MANIFEST_NAME).exists() or len(Manifest.read(tmp_path).shards) < 2
            ):
                assert process.poll() is None
                time.sleep(0.005)
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does
            assert process.wait(20) != 0
            errors = process.stderr.read()
        assert errors.count("Traceback") <= 2, errors
        assert errors.rstrip().endswith("KeyboardInterrupt"), errors
        assert len(Manifest.read(tmp_path).shards) >= 2
        assert not list(tmp_path.glob(".artgym-*"))


@needs("distributed")
def test_a_connected_dask_cluster_is_used_and_left_running(tmp_path):
    script = """
import sys
from distributed import Client, LocalCluster
from artgym.jobs import ShardTask, run_shards

def make(seed):
    import os
    import numpy as np
    return {"pid": np.array(os.getpid())}

with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
    with Client(cluster) as client:
        run_shards([ShardTask("a.h5", 0)], make, sys.argv[1], config={}, backend="dask")
        print(*client.run(lambda: __import__("os").getpid()).values())
"""
    assert _printed(script, tmp_path) == str(read_arrays(tmp_path / "a.h5")[0]["pid"])


@needs("ray")
def test_a_connected_ray_cluster_is_used_and_left_running(tmp_path):
    script = """
import sys
import ray
from artgym.jobs import ShardTask, run_shards

def make(seed):
    import numpy as np
    return {"node": np.frombuffer(ray.get_runtime_context().get_node_id().encode(), np.uint8)}

ray.init(address="local", num_cpus=1, include_dashboard=False, _node_ip_address="127.0.0.1")
run_shards([ShardTask("a.h5", 0)], make, sys.argv[1], config={}, backend="ray")
print(ray.get_runtime_context().get_node_id())
ray.shutdown()
"""
    printed = _printed(script, tmp_path)
    assert printed == bytes(read_arrays(tmp_path / "a.h5")[0]["node"]).decode()


def _printed(script, folder):
    """The last line that a script prints."""
    process = subprocess.run(
        [sys.executable, "-c", script, str(folder)],
        cwd=Path(jobs.__file__).parents[1],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout.splitlines()[-1]


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 128 KiB, which takes a few shards."""
    folder = tmp_path / "disk"
    folder.mkdir()
    try:
        _mount("-t", "tmpfs", "-o", "size=128k", "tmpfs", folder)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no file system can be mounted here: {error}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def _mount(*arguments):
    subprocess.run(["mount", *map(str, arguments)], check=True, capture_output=True)


def _demo(folder, workers):
    return subprocess.Popen(
        [sys.executable, "-c", DEMO, str(folder), workers],
        cwd=Path(jobs.__file__).parents[1],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def _num_shards(folder):
    return len(list(Path(folder).glob("*.h5")))
