"""No circle of files at run time: a file is understood with those below it, and never needs one that needs it."""

import house


def test_no_files_import_each_other():
    assert house.circles(house.imports()) == []


def test_a_circle_through_an_import_inside_a_function_is_found(tmp_path, monkeypatch):
    package = tmp_path / "ringed"
    package.mkdir()
    texts = {"__init__": "", "first": "import ringed.second", "second": "def f():\n    import ringed.first"}
    texts["typed"] = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import ringed.user"
    texts["user"] = "import ringed.typed"
    for name, text in texts.items():
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert house.circles(house.imports("ringed")) == [["ringed.first", "ringed.second"]]
