"""What the process with the HDF5 library answers, asked in this process."""

from __future__ import annotations

import io
import json
import types

import h5py
import numpy as np
import pytest

from mirrorfold.io.readers import hdf5_process


@pytest.fixture
def ask(monkeypatch):
    """Ask questions; returns each answer with the bytes that follow it."""

    def talk(*questions):
        answers = io.BytesIO()
        lines = b"".join(json.dumps(question).encode() + b"\n" for question in questions)
        monkeypatch.setattr(hdf5_process.sys, "stdin", types.SimpleNamespace(buffer=io.BytesIO(lines)))
        monkeypatch.setattr(hdf5_process.sys, "stdout", types.SimpleNamespace(buffer=answers))
        hdf5_process.serve()
        answers.seek(0)
        found = []
        for _ in questions:
            answer = json.loads(answers.readline())
            found.append((answer, answers.read(answer.get("bytes", 0))))
        return found

    return talk


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as content:
        content["s"] = np.arange(6, dtype="<f4").reshape(2, 3)
        content["inner/many"] = np.zeros((400, 400))
        content.create_dataset("inner/chunks", data=np.zeros((400, 400)), chunks=(10, 400))
        content["x"] = np.arange(3.0)
        content["x"].make_scale("x")
        content["s"].dims[0].label = "frequency"
        content["s"].dims[1].attach_scale(content["x"])
        content["s"].attrs["units"] = "V"
        content["name"], content["words"] = "abc", np.array(["a", "b"], dtype=object)
        content["nothing"] = h5py.Empty("f")
        content["times"] = np.zeros(3, "S4")
        content["parts"] = np.zeros(2, [("real", "<f4"), ("imag", "<f4")])
        content["soft"] = h5py.SoftLink("/s")
        content["dangling"] = h5py.SoftLink("/nobody")
        content["void"] = np.zeros(2)
        content["void"].attrs["MATLAB_empty"] = 1
        content.attrs["title"], content.attrs["count"], content.attrs["list"] = "seed", 3, np.arange(4)
        content.attrs["raw"] = np.bytes_(b"\xff")
    return path


def test_arrays_with_shape_type_axes_and_units(ask, file):
    ((answer, _),) = ask({"path": str(file)})
    arrays = {entry["name"]: entry for entry in answer["arrays"]}
    assert set(arrays) == {"s", "x", "name", "parts", "inner/many", "inner/chunks"}
    s = arrays["s"]
    assert (s["shape"], s["descr"], s["dims"], s["attrs"]) == ([2, 3], "<f4", ["frequency", "x"], {"units": "V"})
    assert s["stored"] == 24
    assert arrays["name"]["text"] == "abc"
    assert arrays["parts"]["descr"] == [["real", "<f4"], ["imag", "<f4"]]
    assert answer["attrs"] == {"title": "seed", "count": 3.0, "raw": "\ufffd"}
    assert answer["matlab"] is False


def test_values_follow_as_bytes_and_damage_is_told(ask, file):
    values, missing, after = ask(
        {"path": str(file), "name": "s"}, {"path": str(file), "name": "no"}, {"path": str(file)}
    )
    assert np.frombuffer(values[1], "<f4").tolist() == list(range(6))
    assert "damaged" in missing[0]
    assert "arrays" in after[0]
    file.write_bytes(b"nothing of the kind")
    assert "damaged" in ask({"path": str(file)})[0][0]


def test_files_that_show_others_are_refused(ask, file, tmp_path):
    (tmp_path / "secret").write_bytes(b"12345678")
    for change in ("link", "values"):
        path = tmp_path / f"{change}.h5"
        path.write_bytes(file.read_bytes())
        with h5py.File(path, "a") as content:
            if change == "link":
                content["other"] = h5py.ExternalLink("b.h5", "/s")
            else:
                content.create_dataset("other", (1,), "<f8", external=[(str(tmp_path / "secret"), 0, 8)])
        for question in ({"path": str(path)}, {"path": str(path), "netcdf": True}):
            ((answer, _),) = ask(question)
            assert "another file" in answer["refused"]


def test_groups_that_are_no_tree_are_refused(ask, file, monkeypatch):
    assert set(ask({"path": str(file), "netcdf": True})[0][0]) == {"varying"}
    monkeypatch.setattr(hdf5_process, "MOST_OBJECTS", 5)
    assert "more than 5 objects" in ask({"path": str(file), "netcdf": True})[0][0]["refused"]


def test_a_group_within_itself_is_refused(ask, file):
    with h5py.File(file, "a") as content:
        content["inner/again"] = content["inner"]
    assert "under another name too" in ask({"path": str(file), "netcdf": True})[0][0]["refused"]
