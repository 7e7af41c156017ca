"""No verb replaces a file that it reads, whether the user named it, a scan, a mapping or a scene."""

from __future__ import annotations

import json

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(arguments, path, capsys):
    """Whether a command refuses to replace a file, by itself or by its suffix, and leaves it as it was."""
    before = path.read_bytes()
    assert main([str(word) for word in arguments]) == 2
    ends = "would be overwritten; give another name for the output", "expected .nc; rename it"
    assert capsys.readouterr().err.splitlines()[-1].endswith(ends)
    assert path.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["positions.csv", "tx4_rx4.s2p", "scan.toml"])
def test_import_replaces_nothing_of_the_scan_that_it_reads(sweep, folder, capsys, name):
    mf.save_touchstone(sweep, folder / "scan")
    refused(["import", "scan", "-o", f"scan/{name}"], folder / "scan" / name, capsys)
    assert main(["import", "scan", "-o", "scan/sweep.nc"]) == 0
    assert main(["import", "scan", "-o", "scan/sweep.nc"]) == 0


@pytest.mark.slow
def test_import_replaces_neither_positions_nor_mapping_nor_what_these_name(sweep, folder, capsys):
    mf.save_touchstone(sweep, folder / "scan")
    table = folder / "table.dat"  # of no suffix that tells
    (folder / "scan" / "positions.csv").rename(table)
    (folder / "place.toml").write_text('table = "table.dat"\n')
    options = ["import", "scan", "--positions", "place.toml"]
    refused([*options, "-o", "place.toml"], folder / "place.toml", capsys)
    refused([*options, "-o", "table.dat"], table, capsys)
    np.save("s.npy", np.ones((3, 2), complex))
    (folder / "frequency.csv").write_text("1e9\n2e9\n3e9\n")
    (folder / "map.toml").write_text(
        'time_convention = "exp(+jwt)"\ns = {variable = "array", dims = ["frequency", "position"]}\n'
        'frequency = {file = "frequency.csv"}\nantenna = {x = [0.0, 0.1]}\n'
    )
    options = ["import", "s.npy", "--mapping", "map.toml"]
    refused([*options, "-o", "map.toml"], folder / "map.toml", capsys)
    refused([*options, "-o", "frequency.csv"], folder / "frequency.csv", capsys)


def test_simulate_replaces_no_table_that_the_scene_names(folder, scene_file, capsys):
    (folder / "wall.csv").write_text("-1,2\n-0.5,2.1\n0,2.1\n0.5,2.1\n1,2\n")
    with scene_file.open("a") as file:
        file.write('\n[[surface]]\nname = "bent"\nkind = "curve"\nfile = "wall.csv"\n')
    refused(["simulate", scene_file, "-o", "wall.csv"], folder / "wall.csv", capsys)


def test_simulate_replaces_no_mesh(folder, capsys):
    (folder / "body.stl").write_text("solid body")
    (folder / "scene.toml").write_text(
        'name = "mesh"\ndimensions = 3\nband = {start = 270e9, stop = 300e9, points = 11}\n'
        "[scanner]\nspot_radius = 0.017\nfocus_distance = 3.0\n"
        "azimuth = {start = -8, stop = 8, points = 3}\nelevation = {start = -8, stop = 8, points = 3}\n"
        '[[surface]]\nname = "m"\nkind = "mesh"\nmaterial = "pec"\npath = "body.stl"\nposition = [0, 2, 0.5]\n'
    )
    refused(["simulate", "scene.toml", "-o", "body.stl"], folder / "body.stl", capsys)


def test_an_export_replaces_no_input(image, reconstruction, folder, capsys):
    mf.save(image, "image.nc")
    plan = mf.export(reconstruction, "plan.geojson")
    refused(["fold", "image.nc", "-o", "r.nc", "--mirrors", plan, "--export", plan], plan, capsys)
    refused(["reconstruct", "image.nc", "-o", "out", "--plan", plan, "--export", plan], plan, capsys)
    assert not (folder / "out").exists()
    (folder / "cloud.ply").hardlink_to("image.nc")
    refused(["fold", "image.nc", "-o", "r.nc", "--export", "cloud.ply"], folder / "image.nc", capsys)


def test_the_complaint_is_part_of_the_json(sweep, folder, capsys):
    mf.save(sweep, "sweep.nc")
    assert main(["focus", "sweep.nc", "-o", "sweep.nc", "--json"]) == 2
    assert "is the input itself" in json.loads(capsys.readouterr().err)["error"]


def test_who_calls_the_package_may_replace_what_was_read(sweep, folder):
    path = mf.save(sweep, "sweep.nc")
    mf.save(mf.load(path), path)
