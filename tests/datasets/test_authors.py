"""The authors' released data: values and frames come through, each kind of damage is named."""

from __future__ import annotations

import os
import pickle
from dataclasses import fields

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artgym.datasets.authors import AuthorsFolder, AuthorsSample, read_authors_file
from artgym.errors import DamagedFileError, InvalidArgumentError, UnknownNameError
from artgym.geometry.rotations import JAW_SYMMETRY, grasp_angle
from tests.datasets.authors_factory import (
    random_authors_arrays,
    write_authors_file,
    write_authors_list,
)

DTYPES = {
    "points_camera": np.float32,
    "normals_camera": np.float32,
    "part": np.uint8,
    "npcs": np.float32,
    "naocs": np.float32,
    "joint": np.uint8,
    "joint_axis_naocs": np.float32,
    "direction_to_joint_naocs": np.float32,
    "joint_nearness": np.float32,
    "affordance": np.uint8,
    "R_camera_grasps": np.float32,
    "joint_type": np.int8,
}
THEIR_NAMES = {
    "npcs": "npcs_per_point",
    "naocs": "naocs_per_point",
    "part": "seg_per_point",
    "joint": "joint_cls_per_point",
    "joint_axis_naocs": "axis_per_point",
    "direction_to_joint_naocs": "unitvec_per_point",
    "joint_nearness": "heatmap_per_point",
    "affordance": "grasp_cls_per_point",
    "joint_type": "joint_type",
}


def assert_same(left: AuthorsSample, right: AuthorsSample) -> None:
    for field in fields(AuthorsSample):
        np.testing.assert_array_equal(
            getattr(left, field.name), getattr(right, field.name), err_msg=field.name
        )


@pytest.fixture
def arrays():
    return random_authors_arrays(0)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "0007.h5"


def written(path, arrays, **changes):
    """The file with some datasets changed, or left out where the change is None."""
    changed = {name: array for name, array in {**arrays, **changes}.items() if array is not None}
    write_authors_file(path, changed)
    return path


class TestValues:
    def test_every_field_with_its_dtype_and_shape(self, path, arrays):
        sample = read_authors_file(written(path, arrays))
        assert {field.name for field in fields(AuthorsSample)} == {*DTYPES, "image_id", "urdf_id"}
        assert (sample.image_id, sample.urdf_id, sample.num_parts) == ("0007", 10040, 3)
        for name, dtype in DTYPES.items():
            assert getattr(sample, name).dtype == dtype, name
        for ours, theirs in THEIR_NAMES.items():
            expected = arrays[theirs].astype(DTYPES[ours])
            np.testing.assert_array_equal(getattr(sample, ours), expected, strict=True)

    @pytest.mark.parametrize("normals", [False, True])
    def test_points_with_and_without_normals(self, path, normals):
        arrays = random_authors_arrays(1, normals=normals)
        sample = read_authors_file(written(path, arrays))
        stored = arrays["camcs_per_point"].astype(np.float32)
        np.testing.assert_array_equal(sample.points_camera, stored[:, :3], strict=True)
        if normals:
            np.testing.assert_array_equal(sample.normals_camera, stored[:, 3:], strict=True)
        else:
            assert sample.normals_camera is None

    @pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
    @pytest.mark.parametrize("label_dtype", [np.int64, np.uint8, np.float32])
    def test_numbers_of_any_width(self, path, arrays, dtype, label_dtype):
        for name, array in arrays.items():
            if name == "joint_type":
                arrays[name] = array.astype(np.int32)
            elif name in ("seg_per_point", "joint_cls_per_point", "grasp_cls_per_point"):
                arrays[name] = array.astype(label_dtype)
            elif name not in ("urdf_id", "quats_per_point"):
                arrays[name] = array.astype(dtype)
        sample = read_authors_file(written(path, arrays))
        np.testing.assert_array_equal(sample.part, arrays["seg_per_point"])
        np.testing.assert_array_equal(sample.npcs, arrays["npcs_per_point"].astype(np.float32))

    def test_booleans_are_labels_and_the_number_may_be_a_list_of_one(self, path, arrays):
        arrays["grasp_cls_per_point"] = arrays["grasp_cls_per_point"].astype(bool)
        sample = read_authors_file(written(path, arrays, urdf_id=np.array([11030])))
        np.testing.assert_array_equal(sample.affordance, arrays["grasp_cls_per_point"])
        assert sample.urdf_id == 11030

    def test_what_the_layout_does_not_name_is_left_alone(self, path, arrays):
        extra = np.full((4, 4), np.nan)
        plain = read_authors_file(written(path.with_name("plain") / "0007.h5", arrays))
        assert_same(read_authors_file(written(path, arrays, npcs2cam_rt=extra)), plain)


class TestGrasps:
    def test_columns_are_theirs(self, path, arrays):
        """Their forward, left and up = approach are our x, y = closing and z = approach."""
        rng = np.random.default_rng(3)
        up = rng.normal(size=(50, 3))
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        left = np.cross(up, rng.normal(size=(50, 3)))
        left /= np.linalg.norm(left, axis=1, keepdims=True)
        forward = np.cross(left, up)
        quaternions_xyzw = Rotation.from_matrix(np.stack([forward, left, up], axis=-1)).as_quat()
        sample = read_authors_file(
            written(
                path,
                arrays,
                quats_per_point=quaternions_xyzw,
                grasp_cls_per_point=np.ones(50, int),
            )
        )
        R = sample.R_camera_grasps
        np.testing.assert_allclose(R[:, :, 0], forward, atol=1e-6)
        np.testing.assert_allclose(R[:, :, 1], left, atol=1e-6)
        np.testing.assert_allclose(R[:, :, 2], up, atol=1e-6)
        np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-5)
        half_turned = Rotation.from_matrix(R @ JAW_SYMMETRY).as_matrix()
        np.testing.assert_allclose(grasp_angle(R, half_turned), 0.0, atol=1e-5)

    def test_the_scalar_part_comes_last(self, path, arrays):
        """A quarter turn about the camera's x: their left is the camera's z."""
        arrays["quats_per_point"][:] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
        R = read_authors_file(written(path, arrays)).R_camera_grasps
        expected = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
        np.testing.assert_allclose(R, np.broadcast_to(expected, (50, 3, 3)), atol=1e-6)

    def test_opposite_quaternions_are_one_rotation(self, path, arrays):
        plain = read_authors_file(written(path, arrays))
        opposite = written(path, arrays, quats_per_point=-arrays["quats_per_point"])
        assert_same(read_authors_file(opposite), plain)

    def test_points_without_a_rotation_have_zeros(self, path, arrays):
        R = read_authors_file(written(path, arrays)).R_camera_grasps
        is_absent = (arrays["quats_per_point"] == 0).all(axis=1)
        assert is_absent.any()
        assert (R[is_absent] == 0).all()
        np.testing.assert_allclose(np.linalg.det(R[~is_absent]), 1.0, atol=1e-5)


def edited(name, index, value):
    """A change of one number of a dataset."""

    def edit(arrays):
        array = np.array(arrays[name], dtype=float)
        array[index] = value
        return {name: array}

    return edit


#: Numpy warns of it where it keeps silent about other NaNs.
SIGNALLING_NAN = np.array(0x7FF0000000000001, dtype=np.uint64).view(np.float64)[()]
POINT_FIELDS = sorted(name for name in random_authors_arrays(0) if name.endswith("_per_point"))


class TestDamage:
    @pytest.mark.parametrize("name", sorted(random_authors_arrays(0)))
    def test_missing_fields(self, path, arrays, name):
        with pytest.raises(DamagedFileError, match=rf"0007\.h5 cannot be used: {name} is missing"):
            read_authors_file(written(path, arrays, **{name: None}))

    @pytest.mark.parametrize("name", sorted(random_authors_arrays(0)))
    def test_an_axis_too_many(self, path, arrays, name):
        wrong = arrays[name][..., None, None]
        with pytest.raises(DamagedFileError, match=f"{name} should have shape .* Unpack") as caught:
            read_authors_file(written(path, arrays, **{name: wrong}))
        assert f"got {wrong.shape}" in str(caught.value)

    @pytest.mark.parametrize("name", POINT_FIELDS)
    def test_lengths_that_disagree(self, path, arrays, name):
        with pytest.raises(DamagedFileError, match=r"should have shape \(\d+.*, got \(\d+"):
            read_authors_file(written(path, arrays, **{name: arrays[name][:-1]}))

    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("camcs_per_point", np.zeros((50, 4)), r"or \(1 <= M <= 1048576, 6\), got \(50, 4\)"),
            ("camcs_per_point", np.zeros((0, 3)), r"got \(0, 3\)"),
            ("quats_per_point", np.zeros((50, 3)), r"should have shape \(50, 4\), got \(50, 3\)"),
            ("joint_type", np.zeros(0), r"should have shape \(1 <= K <= 255\), got \(0,\)"),
            ("joint_type", np.zeros(256), r"got \(256,\)"),
            ("urdf_id", np.zeros(2), r"should have shape \(\) or \(1\), got \(2,\)"),
            ("npcs_per_point", h5py.Empty("f4"), "got None"),
            ("npcs_per_point", np.zeros((50, 3), int), "should be floating point, got int64"),
            ("npcs_per_point", np.zeros((50, 3), bool), "should be floating point, got bool"),
            ("npcs_per_point", np.zeros((50, 3), complex), "is not a plain array of numbers"),
            ("npcs_per_point", np.full((50, 3), b"x"), "is not a plain array of numbers"),
            ("seg_per_point", np.full(50, b"x"), "is not a plain array of numbers"),
            ("urdf_id", np.array(b"laptop"), "is not a plain array of numbers"),
        ],
    )
    def test_wrong_shapes_and_types(self, path, arrays, name, value, message):
        with pytest.raises(DamagedFileError, match=f"{name} .*{message}"):
            read_authors_file(written(path, arrays, **{name: value}))

    @pytest.mark.parametrize("value", [np.nan, SIGNALLING_NAN, np.inf, -np.inf])
    @pytest.mark.parametrize("name", sorted(random_authors_arrays(0)))
    def test_not_finite(self, path, arrays, name, value):
        array = arrays[name]
        index = (1,) * array.ndim
        place = rf"{name}\[{', '.join(map(str, index))}\]" if index else name
        with pytest.raises(DamagedFileError, match=rf"{place} should be .*, got {value}"):
            read_authors_file(written(path, arrays, **edited(name, index, value)(arrays)))

    @pytest.mark.parametrize(
        ("edit", "message"),
        [
            (edited("npcs_per_point", (4, 2), 1e300), r"npcs_per_point\[4, 2\] .* got 1e\+300"),
            (edited("seg_per_point", 5, 3), r"seg_per_point\[5\] .* in \[0, 2\], got 3.0"),
            (edited("seg_per_point", 5, 0.5), r"seg_per_point\[5\] should be a whole number"),
            (edited("seg_per_point", 5, -1), r"seg_per_point\[5\] .* got -1.0"),
            (edited("joint_cls_per_point", 6, 3), r"joint_cls_per_point\[6\] .* got 3.0"),
            (edited("grasp_cls_per_point", 7, 2), r"grasp_cls_per_point\[7\] .* in \[0, 1\]"),
            (edited("joint_type", 1, 2), r"joint_type\[1\] .* in \[-1, 1\], got 2.0"),
            (edited("joint_type", 0, 1), r"joint_type\[0\], the base's, should be -1, got 1"),
            (edited("urdf_id", (), -4), r"urdf_id should be a whole number .* got -4.0"),
            (edited("quats_per_point", 1, 0.0), r"quats_per_point\[1\] should have length 1, or 0"),
            (edited("quats_per_point", (8, 1), 2.0), r"quats_per_point\[8\] .* where it is 1"),
            (edited("quats_per_point", (9, 0), 2.0), r"quats_per_point\[9\] .* where it is 0"),
            (edited("quats_per_point", (6, 0), 1e-4), r"quats_per_point\[6\] .* where it is 0"),
        ],
    )
    def test_values_out_of_range(self, path, arrays, edit, message):
        with pytest.raises(DamagedFileError, match=message) as caught:
            read_authors_file(written(path, arrays, **edit(arrays)))
        assert str(path) in str(caught.value)
        assert "Unpack" in str(caught.value)

    def test_groups_and_links_are_not_followed(self, path, arrays, tmp_path):
        np.full((50, 3), 7.0).tofile(tmp_path / "secret.raw")
        secret = written(tmp_path / "secret.h5", arrays)
        layout = h5py.VirtualLayout((50, 3), "f8")
        layout[:] = h5py.VirtualSource(secret, "npcs_per_point", (50, 3))

        def make_external(file):
            place = [(os.fspath(tmp_path / "secret.raw"), 0, 1200)]
            file.create_dataset("npcs_per_point", (50, 3), "f8", external=place)

        makers = {
            "leads out of the file": [
                lambda file: file.create_group("npcs_per_point"),
                lambda file: file.update(npcs_per_point=h5py.SoftLink("/naocs_per_point")),
                lambda file: file.update(npcs_per_point=h5py.ExternalLink(secret, "npcs")),
                lambda file: file.create_virtual_dataset("npcs_per_point", layout),
            ],
            "is not a plain array": [make_external],
        }
        for message, makes in makers.items():
            for make in makes:
                written(path, arrays, npcs_per_point=None)
                with h5py.File(path, "r+") as file:
                    make(file)
                with pytest.raises(DamagedFileError, match=f"npcs_per_point .*{message}"):
                    read_authors_file(path)

    @pytest.mark.parametrize(
        ("name", "shape", "options", "message"),
        [
            ("camcs_per_point", (2**40, 3), {"chunks": (16, 3)}, r"got \(1099511627776, 3\)"),
            ("joint_type", (2**60,), {"chunks": (16,)}, r"got \(1152921504606846976,\)"),
            (
                "npcs_per_point",
                (50, 3),
                {"chunks": (2**25, 3), "maxshape": (None, 3), "compression": "gzip"},
                r"claims chunks of shape \(33554432, 3\)",
            ),
        ],
    )
    def test_huge_claims_are_refused_unread(self, path, arrays, name, shape, options, message):
        written(path, arrays, **{name: None})
        with h5py.File(path, "r+") as file:
            file.create_dataset(name, shape, "f4", **options)
        with pytest.raises(DamagedFileError, match=f"{name} .*{message}"):
            read_authors_file(path)

    def test_what_is_no_file(self, path, tmp_path):
        with pytest.raises(DamagedFileError, match=r"0007\.h5 cannot be used: it is missing"):
            read_authors_file(path)
        with pytest.raises(DamagedFileError, match="it is not a file"):
            read_authors_file(tmp_path)
        os.mkfifo(path)
        with pytest.raises(DamagedFileError, match="it is not a file"):
            read_authors_file(path)

    @pytest.mark.parametrize("size", [0, 7, 100, 2000, 4000, 8000, -1])
    def test_cut_short(self, path, arrays, size):
        written(path, arrays)
        path.write_bytes(path.read_bytes()[:size])
        with pytest.raises(DamagedFileError, match=r"0007\.h5 cannot be used"):
            read_authors_file(path)

    def test_a_flipped_byte_gives_an_error_or_a_sound_sample(self, path, arrays):
        """The layout has no checksums: a changed number can pass, nothing else may."""
        written(path, arrays)
        whole = bytearray(path.read_bytes())
        found = 0
        for position in np.random.default_rng(0).integers(0, len(whole), 300):
            damaged = whole.copy()
            damaged[position] ^= 0x10
            path.write_bytes(damaged)
            try:
                sample = read_authors_file(path)
            except DamagedFileError:
                found += 1
            else:
                for name, dtype in DTYPES.items():
                    assert getattr(sample, name).dtype == dtype
                    assert np.isfinite(getattr(sample, name)).all()
        assert found > 50


@pytest.fixture
def root(tmp_path):
    """Three images of laptops, two to train on and one to test on."""
    for seed in range(3):
        written(tmp_path / "laptop" / f"{seed:04d}.h5", random_authors_arrays(seed))
    write_authors_list(tmp_path / "laptop" / "train.txt", ["0002.json", "", "0000", "0002.png "])
    write_authors_list(tmp_path / "laptop" / "test.txt", ["0001"])
    return tmp_path


class TestFolder:
    def test_reads_like_a_list(self, root):
        samples = AuthorsFolder(root, "laptop", "train")
        assert len(samples) == 2
        assert [sample.image_id for sample in samples] == ["0002", "0000"]
        assert samples[np.int64(-1)].urdf_id == 10040
        assert [sample.urdf_id for sample in samples[:1]] == [10042]
        assert AuthorsFolder(root, "laptop", "test")[0].urdf_id == 10041
        with pytest.raises(IndexError, match="index 2 is outside the 2 of"):
            samples[2]

    def test_files_in_another_folder(self, root):
        (root / "laptop_new").mkdir()
        for path in (root / "laptop").glob("*.h5"):
            path.rename(root / "laptop_new" / path.name)
        samples = AuthorsFolder(root, "laptop", "train", folder=root / "laptop_new")
        assert samples[0].image_id == "0002"
        with pytest.raises(DamagedFileError, match=r"0002\.h5 is missing; 2 of the 2 .* folder="):
            AuthorsFolder(root, "laptop", "train")
        with pytest.raises(DamagedFileError, match=r"nowhere cannot be listed.* folder="):
            AuthorsFolder(root, "laptop", "train", folder=root / "nowhere")

    def test_pickles_and_keeps_no_file_open(self, root):
        samples = AuthorsFolder(root, "laptop", "train")
        first = samples[0]
        (root / "laptop" / "0002.h5").rename(root / "kept.h5")
        copy = pickle.loads(pickle.dumps(samples))
        with pytest.raises(DamagedFileError, match=r"0002\.h5 cannot be used: it is missing"):
            copy[0]
        (root / "kept.h5").rename(root / "laptop" / "0002.h5")
        assert_same(copy[0], first)
        assert_same(pickle.loads(pickle.dumps(first)), first)

    def test_a_damaged_file_hurts_only_itself(self, root):
        (root / "laptop" / "0002.h5").write_bytes(b"")
        samples = AuthorsFolder(root, "laptop", "train")
        assert samples[1].image_id == "0000"
        with pytest.raises(DamagedFileError, match=r"laptop/0002\.h5 cannot be used"):
            samples[0]

    @pytest.mark.parametrize("category", ["", "..", "../laptop", "a/b", "a\\b", "laptop\0", "/"])
    def test_categories_that_are_no_names(self, root, category):
        with pytest.raises(InvalidArgumentError, match=r"category .* cannot be used"):
            AuthorsFolder(root, category, "train")

    def test_unknown_split(self, root):
        with pytest.raises(UnknownNameError, match=r"unknown split 'tests'\. Nearest: 'test'"):
            AuthorsFolder(root, "laptop", "tests")

    @pytest.mark.parametrize(
        ("line", "shown"),
        [
            ("../0000", "'../0000'"),
            ("a/0000", "'a/0000'"),
            ("/etc/passwd", "'/etc/passwd'"),
            ("a\\0000", r"'a\\\\0000'"),
            ("C:0000", "'C:0000'"),
            ("..", r"'\.\.'"),
            (".hidden", r"'\.hidden'"),
            ("0000..h5", r"'0000\.\.h5'"),
            ("0000/../../x.h5", r"'0000/\.\./\.\./x\.h5'"),
            ("00\x0000", r"'00\\x0000'"),
            ("ü", "'ü'"),
            ("x" * 300, f"'{'x' * 80}'"),
        ],
    )
    def test_ids_that_are_no_names(self, root, line, shown):
        write_authors_list(root / "laptop" / "train.txt", ["0000", line])
        with pytest.raises(DamagedFileError, match=r"train\.txt cannot be used: line 2 .* got .*"):
            AuthorsFolder(root, "laptop", "train")
        with pytest.raises(DamagedFileError, match=shown):
            AuthorsFolder(root, "laptop", "train")

    def test_lists_that_cannot_be_used(self, root, monkeypatch):
        path = root / "laptop" / "train.txt"
        for content, message in [
            (b"", "it lists no image ids"),
            (b"\n \r\n", "it lists no image ids"),
            (b"\xff\xfe0\x00", "codec can't decode"),
        ]:
            path.write_bytes(content)
            with pytest.raises(DamagedFileError, match=rf"train\.txt cannot be used: .*{message}"):
                AuthorsFolder(root, "laptop", "train")
        monkeypatch.setattr("artgym.datasets.authors._MAX_LIST_BYTES", 3)
        path.write_bytes(b"0000")
        with pytest.raises(DamagedFileError, match="it should have 3 bytes at most, got 4"):
            AuthorsFolder(root, "laptop", "train")
        path.unlink()
        with pytest.raises(DamagedFileError, match=r"train\.txt cannot be used: it is missing"):
            AuthorsFolder(root, "laptop", "train")
        with pytest.raises(DamagedFileError, match=r"oven/train\.txt cannot be used: it is miss"):
            AuthorsFolder(root, "oven", "train")
