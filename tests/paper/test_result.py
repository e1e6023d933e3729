import json

import numpy as np

from midair.paper.result import PaperResult


def test_files_are_whole_and_infinities_are_null(tmp_path):
    rows = ({"mode": "paper", "value": float("inf")}, {"mode": "best", "value": 1.0})
    result = PaperResult(name="table", title="", rows=rows, pictures={"a.png": b"picture"})
    assert [path.name for path in result.write(tmp_path / "new")] == ["table.csv", "table.json", "a.png"]
    assert json.loads((tmp_path / "new" / "table.json").read_text())["rows"][0]["value"] is None
    assert (tmp_path / "new" / "table.csv").read_text() == "mode,value\npaper,inf\nbest,1\n"
    assert not np.isnan(rows[0]["value"])
