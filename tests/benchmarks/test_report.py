"""Pages quote what the kept results say."""

from __future__ import annotations

import pytest

from artgym.errors import DamagedFileError, InvalidArgumentError
from benchmarks import report


@pytest.mark.parametrize("path", report.PAGES, ids=lambda path: path.parent.name)
def test_page_agrees_with_the_results(path):
    page = path.read_text(encoding="utf-8")
    assert "<!-- " in page
    assert page == report.filled(page), "run python -m benchmarks.report"


def test_block_without_end_is_refused():
    with pytest.raises(InvalidArgumentError, match="never closed"):
        report.filled("<!-- success_rate -->")


def test_missing_result_is_named(tmp_path):
    page = "<!-- object_table -->\n<!-- /object_table -->"
    with pytest.raises(DamagedFileError, match=r"object_table\.json"):
        report.filled(page, tmp_path)
