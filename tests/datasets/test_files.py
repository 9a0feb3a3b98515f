"""Files: round trips, equal bytes, and one clear error for each kind of damage."""

from __future__ import annotations

import dataclasses
import errno
import json
import multiprocessing
import os
import pickle
import sys
import time
from contextlib import contextmanager
from typing import ClassVar

import h5py
import numpy as np
import pytest

from artgym.datasets import picture_files
from artgym.datasets.picture_files import (
    PictureFolder,
    SampleFolder,
    read_pictures,
    write_pictures,
)
from artgym.datasets.sample import PICTURE_ARRAYS, SAMPLE_ARRAYS, Picture
from artgym.errors import DamagedFileError, FileNotWrittenError, InvalidArgumentError
from artgym.files import (
    MANIFEST_NAME,
    Manifest,
    ShardEntry,
    read_arrays,
    remove_stale_temporaries,
    write_arrays,
    write_file_whole,
)
from tests.datasets.picture_factory import random_picture

CONFIG = {"seed": 7, "camera": {"width": 32, "height": 24}, "categories": ["laptop"]}


def assert_same(left, right):
    """Two pictures, or two samples, are equal to the bit."""
    names = PICTURE_ARRAYS if isinstance(left, Picture) else SAMPLE_ARRAYS
    if isinstance(left, Picture):
        for mine, other in zip(left.samples, right.samples, strict=True):
            assert_same(mine, other)
    else:
        assert left.object_id == right.object_id
    for name in names:
        a, b = getattr(left, name), getattr(right, name)
        assert isinstance(b, np.ndarray), name
        assert a.dtype == b.dtype, name
        np.testing.assert_array_equal(a, b, err_msg=name, strict=True)


@pytest.fixture
def folder(tmp_path):
    """Three shards of 2, 0 and 3 pictures with a manifest."""
    entries = []
    for number, seeds in enumerate([(0, 1), (), (2, 3, 4)]):
        path = tmp_path / "set" / f"train-{number}.h5"
        write_pictures(path, [random_picture(seed) for seed in seeds])
        entries.append(ShardEntry.of(path, len(seeds)))
    Manifest(config=CONFIG, planned=3, shards=tuple(entries)).write(tmp_path / "set")
    return tmp_path / "set"


class TestWholeFiles:
    def test_replaces_and_makes_parents(self, tmp_path):
        path = tmp_path / "a" / "b.bin"
        write_file_whole(path, b"one")
        write_file_whole(path, lambda temporary: temporary.write_bytes(b"two") and None)
        assert path.read_bytes() == b"two"
        assert list(path.parent.iterdir()) == [path]

    def test_permissions_follow_the_umask(self, tmp_path):
        (tmp_path / "plain").write_bytes(b"")
        write_file_whole(tmp_path / "whole", b"")
        assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode

    def test_failing_writer_leaves_the_old_file(self, tmp_path):
        path = tmp_path / "x"
        write_file_whole(path, b"old")

        def fail(temporary):
            temporary.write_bytes(b"half")
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_file_whole(path, fail)
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize("call", ["fsync", "replace"])
    def test_full_disk(self, tmp_path, monkeypatch, call):
        path = tmp_path / "x"
        write_file_whole(path, b"old")

        def refuse(*_):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(os, call, refuse)
        with pytest.raises(FileNotWrittenError, match="Free some space") as caught:
            write_file_whole(path, b"new")
        assert str(path) in str(caught.value)
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]

    def test_file_where_a_folder_should_be(self, tmp_path):
        (tmp_path / "file").write_bytes(b"")
        with pytest.raises(FileNotWrittenError, match=r"cannot write .*file/x\.h5"):
            write_pictures(tmp_path / "file" / "x.h5", [])

    def test_stale_temporaries_go_and_nothing_else(self, tmp_path):
        for name in (".artgym-x.h5.12-ab.tmp", ".other.tmp", "x.h5"):
            (tmp_path / name).write_bytes(b"")
        remove_stale_temporaries(tmp_path)
        assert sorted(p.name for p in tmp_path.iterdir()) == [".other.tmp", "x.h5"]


@contextmanager
def frames_held():
    """Every call's frame, and what it has, lives on, as a profiler may have it."""
    frames = []
    before = sys.getprofile()
    sys.setprofile(lambda frame, event, argument: frames.append(frame))
    try:
        yield
    finally:
        sys.setprofile(before)


class TestPictures:
    def test_every_field_has_a_declared_shape(self):
        names = {*PICTURE_ARRAYS, *SAMPLE_ARRAYS}
        assert set(picture_files._SHAPES) == set(picture_files._DTYPES) == names

    @pytest.mark.parametrize(
        "sizes",
        [
            {},
            {"num_points": 4096, "num_grasp_points": 200, "height": 60, "width": 80},
            {"num_points": 0, "num_grasp_points": 0},
            {"num_parts": 1, "num_points": 1},
            {"num_objects": 0},
            {"num_objects": 4},
        ],
    )
    def test_round_trip(self, tmp_path, sizes):
        samples = [random_picture(seed, **sizes) for seed in range(3)]
        write_pictures(tmp_path / "x.h5", samples)
        for left, right in zip(samples, read_pictures(tmp_path / "x.h5"), strict=True):
            assert_same(left, right)

    def test_views_in_any_memory_order(self, tmp_path):
        sample = random_picture(0)
        flipped = dataclasses.replace(sample, depth=np.asfortranarray(sample.depth))
        write_pictures(tmp_path / "x.h5", [flipped])
        assert_same(sample, read_pictures(tmp_path / "x.h5")[0])

    def test_same_bytes_later_and_elsewhere(self, tmp_path):
        write_pictures(tmp_path / "a.h5", [random_picture(0), random_picture(1)])
        time.sleep(1.1)  # beyond the resolution of HDF5's time stamps
        write_pictures(tmp_path / "b.h5", [random_picture(0), random_picture(1)])
        assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()

    def test_same_bytes_beside_a_profiler(self, tmp_path):
        pictures = [random_picture(seed, height=60, width=80) for seed in range(4)]
        write_pictures(tmp_path / "a.h5", pictures)
        with frames_held():
            write_pictures(tmp_path / "b.h5", pictures)
        assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()

    @pytest.mark.parametrize(
        ("field", "value", "message"),
        [
            ("depth", np.zeros((24, 32)), "depth should be float32, got float64"),
            ("depth", np.zeros((24, 31), np.float32), r"depth should have shape \(24, 32\)"),
            ("part", np.zeros((50, 1), np.uint8), r"part should have shape \(50\)"),
            ("object_scale", np.float32(np.nan), "object_scale holds values that are not finite"),
        ],
    )
    def test_misfits_are_refused(self, tmp_path, field, value, message):
        picture, where = random_picture(0), "picture 1"
        if field in SAMPLE_ARRAYS:
            sample = dataclasses.replace(picture.samples[0], **{field: value})
            picture = dataclasses.replace(picture, samples=(sample,))
            where = "sample 0 of picture 1 (laptop/0000)"
        else:
            picture = dataclasses.replace(picture, **{field: value})
        with pytest.raises(InvalidArgumentError, match=message) as caught:
            write_pictures(tmp_path / "x.h5", [random_picture(1), picture])
        assert where in str(caught.value)
        assert not (tmp_path / "x.h5").exists()

    @pytest.mark.parametrize("size", [0, 7, 100, 4000, -1])
    def test_cut_short(self, tmp_path, size):
        path = tmp_path / "x.h5"
        write_pictures(path, [random_picture(0)])
        path.write_bytes(path.read_bytes()[:size])
        with pytest.raises(DamagedFileError, match=r"x\.h5 is damaged"):
            read_pictures(path)

    def test_missing_foreign_and_other_version(self, tmp_path):
        with pytest.raises(DamagedFileError, match=r"x\.h5 is missing"):
            read_pictures(tmp_path / "x.h5")
        with h5py.File(tmp_path / "foreign.h5", "w") as file:
            file["data"] = np.zeros(3)
        with pytest.raises(DamagedFileError, match=r"foreign\.h5 is damaged"):
            read_pictures(tmp_path / "foreign.h5")
        write_arrays(tmp_path / "arrays.h5", {})
        with pytest.raises(DamagedFileError, match="not 'artgym-pictures'"):
            read_pictures(tmp_path / "arrays.h5")

    def test_other_version(self, tmp_path, monkeypatch):
        monkeypatch.setattr(picture_files, "PICTURES_VERSION", 1)
        write_pictures(tmp_path / "x.h5", [])
        monkeypatch.undo()
        with pytest.raises(InvalidArgumentError, match=r"x\.h5 has schema version 1, .* reads 2"):
            read_pictures(tmp_path / "x.h5")

    def test_links_out_of_the_file_are_not_followed(self, tmp_path):
        write_pictures(tmp_path / "secret.h5", [random_picture(0)])
        write_pictures(tmp_path / "x.h5", [random_picture(0)])
        with h5py.File(tmp_path / "x.h5", "r+") as file:
            del file["000000/depth"]
            file["000000/depth"] = h5py.ExternalLink("secret.h5", "000000/depth")
        with pytest.raises(DamagedFileError, match="no array 'depth'"):
            read_pictures(tmp_path / "x.h5")

    def test_huge_claims_are_refused_unread(self, tmp_path):
        write_pictures(tmp_path / "x.h5", [random_picture(0)])
        with h5py.File(tmp_path / "x.h5", "r+") as file:
            del file["000000/depth"]
            file["000000"].create_dataset("depth", (2**20, 2**20), "f4", chunks=(16, 16))
        with pytest.raises(DamagedFileError, match="depth claims 4398046511104 bytes"):
            read_pictures(tmp_path / "x.h5")


class TestArrays:
    ARRAYS: ClassVar = {
        "bits": np.random.default_rng(0).integers(0, 256, (300, 25)).astype(np.uint8),
        "0012/normals": np.random.default_rng(1).normal(size=(300, 3)),
        "0012/deep/flag": np.array(True),
        "empty": np.zeros((0, 3), np.float32),
    }
    ATTRIBUTES: ClassVar = {"trials": 12, "nested": {"ünï": [1.5, None]}, "long": "x" * 10**5}

    def test_round_trip_and_order(self, tmp_path):
        write_arrays(tmp_path / "a.h5", self.ARRAYS, self.ATTRIBUTES)
        backwards = dict(reversed(self.ARRAYS.items()))
        write_arrays(tmp_path / "b.h5", backwards, self.ATTRIBUTES)
        assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
        arrays, attributes = read_arrays(tmp_path / "a.h5")
        assert attributes == self.ATTRIBUTES
        assert list(arrays) == sorted(self.ARRAYS)
        for name, array in arrays.items():
            np.testing.assert_array_equal(array, self.ARRAYS[name], strict=True)

    @pytest.mark.parametrize(
        ("arrays", "attributes"),
        [
            ({"x": np.array(["text"])}, {}),
            ({"x": np.array([object()])}, {}),
            ({"../x": np.zeros(1)}, {}),
            ({"": np.zeros(1)}, {}),
            ({"a": np.zeros(1), "a/b": np.zeros(1)}, {}),
            ({}, {"x": float("nan")}),
            ({}, {"x": object()}),
        ],
    )
    def test_what_cannot_be_stored_is_refused(self, tmp_path, arrays, attributes):
        with pytest.raises(InvalidArgumentError):
            write_arrays(tmp_path / "x.h5", arrays, attributes)
        assert not (tmp_path / "x.h5").exists()

    def test_a_flipped_byte_is_found_or_harmless(self, tmp_path):
        arrays = {"bits": self.ARRAYS["bits"], "small": np.arange(9)}
        write_arrays(tmp_path / "a.h5", arrays, {"git": "abc"})
        whole = bytearray((tmp_path / "a.h5").read_bytes())
        found = 0
        for position in np.random.default_rng(0).integers(0, len(whole), 150):
            damaged = whole.copy()
            damaged[position] ^= 0x10
            (tmp_path / "b.h5").write_bytes(damaged)
            try:
                read, attributes = read_arrays(tmp_path / "b.h5")
            except DamagedFileError:
                found += 1
            else:
                assert attributes == {"git": "abc"}
                assert all(np.array_equal(read[name], arrays[name]) for name in arrays)
        assert found > 100


class TestManifest:
    def test_round_trip_sorted_and_same_bytes(self, tmp_path):
        shards = [
            ShardEntry(name=name, sha256="0" * 64, bytes=1, items=2) for name in ("b", "c", "a")
        ]
        manifest = Manifest(config={"sizes": (1, 2)}, planned=4)
        for shard in shards:
            manifest = manifest.with_shard(shard)
        manifest.write(tmp_path / "x")
        Manifest(config={"sizes": [1, 2]}, planned=4, shards=tuple(shards)).write(tmp_path / "y")
        written = (tmp_path / "x" / MANIFEST_NAME).read_bytes()
        assert written == (tmp_path / "y" / MANIFEST_NAME).read_bytes()
        assert Manifest.read(tmp_path / "x") == manifest
        assert [shard.name for shard in manifest.shards] == ["a", "b", "c"]
        assert manifest.num_items == 6
        assert not manifest.is_complete

    def test_differences_are_named(self, folder):
        wanted = {"seed": 7, "camera": {"width": 64, "height": 24}, "lights": 2}
        with pytest.raises(InvalidArgumentError) as caught:
            Manifest.read(folder).require_config(folder, wanted)
        message = str(caught.value)
        assert str(folder) in message
        assert "config.camera.width is 32 in the folder, 64 asked" in message
        assert "config.lights is absent in the folder, 2 asked" in message
        assert "config.categories is ['laptop'] in the folder, absent asked" in message
        assert "height" not in message

    @pytest.mark.parametrize(
        "content",
        [
            b"",
            b"{",
            b"\xff\xfe",
            b"[]",
            b"null",
            b"{}",
            b"[" * 100000,
            b'{"format": "artgym-folder", "schema_version": 1, "config": {}, "planned": 1.5}',
        ],
    )
    def test_not_a_manifest(self, folder, content):
        (folder / MANIFEST_NAME).write_bytes(content)
        with pytest.raises(DamagedFileError, match=r"manifest\.json is damaged.*delete the folder"):
            SampleFolder(folder)

    @pytest.mark.parametrize(
        ("key", "value"),
        [("name", "../x.h5"), ("name", 3), ("bytes", -1), ("items", "2"), ("sha256", "0")],
    )
    def test_bad_entries(self, folder, key, value):
        content = json.loads((folder / MANIFEST_NAME).read_text())
        content["shards"][0][key] = value
        (folder / MANIFEST_NAME).write_text(json.dumps(content))
        with pytest.raises(DamagedFileError, match=r"manifest\.json is damaged"):
            Manifest.read(folder)

    def test_other_version_and_no_manifest(self, folder, tmp_path):
        content = json.loads((folder / MANIFEST_NAME).read_text())
        (folder / MANIFEST_NAME).write_text(json.dumps({**content, "schema_version": 9}))
        with pytest.raises(InvalidArgumentError, match=r"manifest\.json has schema version 9"):
            SampleFolder(folder)
        with pytest.raises(DamagedFileError, match=r"nowhere/manifest\.json is missing"):
            SampleFolder(tmp_path / "nowhere")


def _point_sum(folder: SampleFolder, index: int) -> float:
    return float(folder[index].points_camera.sum())


class TestPictureFolder:
    def test_pictures_and_their_samples_come_in_the_same_order(self, tmp_path):
        pictures = [random_picture(seed, num_objects=n) for seed, n in enumerate((2, 0, 3))]
        write_pictures(tmp_path / "a.h5", pictures[:2])
        write_pictures(tmp_path / "b.h5", pictures[2:])
        shards = tuple(
            ShardEntry.of(tmp_path / name, items) for name, items in (("a.h5", 2), ("b.h5", 1))
        )
        Manifest(config={}, planned=2, shards=shards).write(tmp_path)
        for mine, theirs in zip(PictureFolder(tmp_path), pictures, strict=True):
            assert_same(mine, theirs)
        samples = [sample for picture in pictures for sample in picture.samples]
        for mine, theirs in zip(SampleFolder(tmp_path), samples, strict=True):
            assert_same(mine, theirs)

    def test_a_count_that_is_a_lie_is_found(self, tmp_path):
        write_pictures(tmp_path / "a.h5", [random_picture(0)])
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            file["objects"][0] = 2
        with pytest.raises(DamagedFileError, match="there is no group 'object_001'"):
            read_pictures(tmp_path / "a.h5")


class TestSampleFolder:
    def test_reads_like_a_list(self, folder):
        samples = SampleFolder(folder)
        assert len(samples) == 5
        assert [s.object_id for s in samples] == [f"laptop/{seed:04d}" for seed in range(5)]
        assert_same(samples[np.int64(3)], random_picture(3).samples[0])
        assert samples[-1].object_id == "laptop/0004"
        assert [s.object_id for s in samples[1:3]] == ["laptop/0001", "laptop/0002"]
        with pytest.raises(IndexError, match="index 5 is outside the 5 of"):
            samples[5]

    @pytest.mark.parametrize("method", ["fork", "spawn"])
    def test_other_processes(self, folder, method):
        samples = SampleFolder(folder)
        expected = [_point_sum(samples, index) for index in (0, 4)]
        assert [_point_sum(pickle.loads(pickle.dumps(samples)), i) for i in (0, 4)] == expected
        with multiprocessing.get_context(method).Pool(1) as pool:
            assert pool.starmap(_point_sum, [(samples, 0), (samples, 4)]) == expected

    def test_incomplete_only_when_allowed(self, folder):
        dataclasses.replace(Manifest.read(folder), planned=4).write(folder)
        with pytest.raises(InvalidArgumentError, match="3 of 4 shards"):
            SampleFolder(folder)
        assert len(SampleFolder(folder, allow_incomplete=True)) == 5

    def test_missing_and_truncated_shards_are_found_at_once(self, folder):
        path = folder / "train-2.h5"
        path.write_bytes(path.read_bytes()[:-10])
        with pytest.raises(DamagedFileError, match=r"train-2\.h5 is damaged: expected \d+ bytes"):
            SampleFolder(folder)
        path.unlink()
        with pytest.raises(DamagedFileError, match=r"train-2\.h5 is damaged.*it is missing"):
            SampleFolder(folder)

    def test_a_flipped_byte_is_found_before_the_first_sample(self, folder):
        path = folder / "train-2.h5"
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        samples = SampleFolder(folder)
        assert_same(samples[0], random_picture(0).samples[0])
        with pytest.raises(DamagedFileError, match=r"train-2\.h5 has another checksum.*Copy it"):
            samples[2]

    def _rewritten(self, folder, change):
        """The first shard after a change that its manifest knows of."""
        path = folder / "train-0.h5"
        with h5py.File(path, "r+") as file:
            change(file)
        manifest = Manifest.read(folder)
        shards = (ShardEntry.of(path, 2), *manifest.shards[1:])
        dataclasses.replace(manifest, shards=shards).write(folder)
        return SampleFolder(folder)

    def test_a_shard_that_does_not_say_where_its_samples_lie_reads_the_same(self, folder):
        def forget(file):
            del file["sample_places"]

        samples = self._rewritten(folder, forget)
        for index in range(2):
            assert_same(samples[index], random_picture(index).samples[0])

    @pytest.mark.parametrize("column", [0, 5])
    @pytest.mark.parametrize("value", [-7, 2**40])
    def test_places_outside_the_file_are_found(self, folder, column, value):
        def lie(file):
            file["sample_places"][0, column] = value

        with pytest.raises(DamagedFileError, match=r"train-0\.h5"):
            self._rewritten(folder, lie)[0]

    def test_places_of_another_number_of_samples_are_found(self, folder):
        def shorten(file):
            places = file["sample_places"][:1]
            del file["sample_places"]
            file["sample_places"] = places

        with pytest.raises(DamagedFileError, match="for 2 samples"):
            self._rewritten(folder, shorten)[0]

    def test_a_sample_without_labels(self, tmp_path):
        picture = random_picture(0)
        (sample,) = picture.samples
        empty = {
            name: getattr(sample, name)[:0]
            for name in ("grasp_bits", "grasp_points_part", "grasp_normals_part", "grasp_part")
        }
        bare = dataclasses.replace(sample, grasp_row=np.full_like(sample.grasp_row, -1), **empty)
        write_pictures(tmp_path / "a.h5", [dataclasses.replace(picture, samples=(bare,))])
        shards = (ShardEntry.of(tmp_path / "a.h5", 1),)
        Manifest(config={}, planned=1, shards=shards).write(tmp_path)
        assert_same(SampleFolder(tmp_path)[0], bare)
