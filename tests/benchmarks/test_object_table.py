"""Table 1: who is compared with whom, and what the rows say."""

from __future__ import annotations

import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError, UnknownNameError
from benchmarks import perception
from benchmarks.object_table import MEAN, ObjectTableConfig, _means, report, tables_from_result
from benchmarks.paper import METHOD_LABELS, TABLE_1
from benchmarks.report import object_table_block
from benchmarks.views import _optimized
from icaf4_policy.inference import Perception
from icaf4_policy.metrics import pose_errors
from icaf4_policy.pose_fitting import PoseFit
from icaf4_policy.prediction import JointEstimate
from icaf4_policy.targets import true_part_boxes
from tests.icaf4_policy.toy import toy_network, toy_sample


def test_the_paper_has_a_row_for_every_method_and_category():
    assert set(TABLE_1) == set(METHOD_LABELS) - {"no_faces", "another_seed"}
    for rows in TABLE_1.values():
        assert set(rows) == set(SETS["artimage"])


def test_the_mean_is_over_the_papers_categories_and_the_methods_that_have_all():
    metrics = {c: {"icaf4": {"part_miou": 0.1 * i}} for i, c in enumerate(SETS["artimage"])}
    metrics["laptop"]["fpfh"] = {"part_miou": 0.5}
    metrics["box"] = {"icaf4": {"part_miou": 9.0}}
    assert _means(metrics) == {MEAN: {"icaf4": {"part_miou": pytest.approx(0.2)}}}
    del metrics["laptop"]
    assert _means(metrics) == {}


def test_tables_show_ours_the_papers_and_chance():
    row = {"part_miou": 0.987, "grasp/network/error_deg": 12.3}
    row["grasp/normal_grid_roll/error_deg"] = 45.6
    result = {"metrics": {"laptop": {"icaf4": row, "fpfh": {"part_miou": 0.321}}}, "paper": TABLE_1}
    console = Console(width=250, record=True, file=io.StringIO())
    for table in tables_from_result(result):
        console.print(table)
    text = console.export_text()
    for shown in ("0.987", "12.3", "45.6", "0.321", "0.950", "14.7", "ICAF-4", "FPFH", "promised"):
        assert shown in text


def test_baselines_need_data_and_a_place():
    with pytest.raises(InvalidArgumentError, match="data=data and work=None"):
        ObjectTableConfig(data=Path("data"))
    config = ObjectTableConfig(data=Path("data"), work=Path("work"))
    assert set(config.weights_of("laptop")) == {*TABLE_1, "no_faces"}
    assert set(config.weights_of("box")) == {"icaf4", "no_faces"}


def test_another_seed_has_a_line_where_there_is_one(tmp_path):
    (tmp_path / "stapler.safetensors").touch()
    config = ObjectTableConfig(another_seed=tmp_path)
    assert config.weights_of("stapler")["another_seed"] == tmp_path
    assert "another_seed" not in config.weights_of("cutter")


def test_noisy_depth_is_another_result(tmp_path):
    plain = ObjectTableConfig(
        category=("stapler",), split="val", objects=1, views=1, workers=1, out=tmp_path
    )
    results = []
    for config, name in (
        (plain, "object_table"),
        (dataclasses.replace(plain, depth_noise=True), "object_table_noise"),
    ):
        assert list(report(config))
        results.append(json.loads((tmp_path / f"{name}.json").read_text()))
    first, second = (result["metrics"]["stapler"]["icaf4"] for result in results)
    assert first["part_translation_m"] != second["part_translation_m"]
    assert "sensor" not in object_table_block(results[0])
    assert "sensor" in object_table_block(results[1])


def test_an_unknown_table_is_named(capsys):
    assert perception.main(["table4"]) == 2
    assert str(UnknownNameError("table", "table4", perception.TABLES)) in capsys.readouterr().err


def test_the_optimizer_fits_the_parts_that_were_found():
    sample = toy_sample(0)
    perceived = Perception(model=toy_network(), category="toy").predict(
        sample.points_camera, sample.colors, sample.R_level_camera, rng=np.random.default_rng(0)
    )
    boxes = tuple(
        PoseFit(T_camera_box=T, scale=float(scale), inlier_share=1.0)
        for T, scale in zip(true_part_boxes(sample), sample.part_scales, strict=True)
    )
    joints = tuple(
        JointEstimate(joint_type=int(kind), axis_camera=axis, pivot_camera=pivot)
        for kind, axis, pivot in zip(
            sample.joint_type,
            sample.joint_axis_camera.astype(float),
            sample.joint_pivot_camera.astype(float),
            strict=True,
        )
    )
    truthful = dataclasses.replace(
        perceived,
        part=sample.part[perceived.point_index].astype(np.int64),
        npcs=sample.npcs[perceived.point_index].astype(float),
        part_boxes=boxes,
        joints=joints,
    )
    fitted = _optimized(truthful, np.random.default_rng(0))
    assert fitted.object_boxes == (None, None)
    found = np.stack([box.T_camera_box for box in fitted.part_boxes])
    rotation, translation = pose_errors(found, true_part_boxes(sample))
    assert np.degrees(rotation).max() < 1.0
    assert translation.max() < 0.005
