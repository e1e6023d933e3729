from midair.study.statistics.columns import cell_means


def test_trials_are_averaged():
    table = {"v": [1.0, 3, 5, 7, 9, 11], "who": list("aaabbb"), "x": list("sstsst")}
    cells = cell_means(table, value="v", participant="who", within=["x"])
    assert cells.mean.tolist() == [[2, 5], [8, 11]]
    assert (cells.participants, cells.levels) == (("a", "b"), (("s", "t"),))
