"""What verbs print with ``--json`` is what `mirrorfold schema` promises, field by field."""

from __future__ import annotations

import dataclasses
import json
import os
import pty
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pydantic
import pytest
from scans import ball, content, panel
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import VERBS, main
from mirrorfold.cli.schema import OUTPUTS, check, describe_fields, json_schema, models, outputs
from mirrorfold.scenes.families import FAMILIES, RADARS

PLAN = ["--band", "270e9:300e9", "--points", "101", "--aperture", "0.02", "--pitch", "0.5e-3", "--range", "1"]


def checked(capsys, verb, *arguments, code=0):
    """The record that a verb prints, which must be all that it prints, with every field that is printed."""
    assert main([verb, *arguments, "--json"]) == code
    printed = capsys.readouterr().out
    found = check(verb, printed)
    assert found == json.loads(printed)
    return found


def test_every_verb_has_a_schema():
    assert set(VERBS) - {"schema"} == set(outputs())


@pytest.mark.parametrize("verb", OUTPUTS)
def test_schemas_can_be_printed_and_documented(verb, capsys):
    if verb not in VERBS:
        pytest.skip(f"there is no verb {verb}")
    assert main(["schema", verb]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json_schema(verb)
    for model in models(OUTPUTS[verb]):
        described = describe_fields(model)
        assert [name for name, _, _ in described] == [item.name for item in dataclasses.fields(model)]
        assert all(kind != "anything" for _, kind, _ in described)


def test_a_field_that_is_not_promised_is_refused():
    with pytest.raises(pydantic.ValidationError):
        check("view", '{"kind": "view", "address": "http://127.0.0.1:1", "more": 1}')
    with pytest.raises(pydantic.ValidationError):
        check("completion", '{"kind": "completion", "shell": "bash"}')


@pytest.mark.slow
def test_the_chain_from_a_scene_to_a_score(folder, capsys):
    simulated = checked(capsys, "simulate", "scene.toml", "-o", "s.nc")
    assert simulated.files == ["s.nc"]
    truth = mf.load_scene("scene.toml")
    assert simulated.dimensions == {
        "frequency": truth.band.points, "tx": truth.array.elements, "rx": truth.array.elements
    }  # fmt: skip
    assert "gate" in checked(capsys, "calibrate", "s.nc", "-o", "c.nc", "--gate", "0.1:").processing[-1]
    grid = ["--x", "-0.25:0.25:0.005", "--y", "0.2:0.45:0.005"]
    image = checked(capsys, "focus", "c.nc", "-o", "i.nc", *grid)
    assert (image.type, image.dimensions) == ("complex64", {"y": 51, "x": 101})
    folded = checked(capsys, "fold", "i.nc", "-o", "r.nc")
    assert folded.files == ["r.nc"]
    assert sum(folded.points_by_bounces.values()) == folded.points > 0
    assert checked(capsys, "reconstruct", "s.nc", "-o", "out").files[0] == "out/reconstruction.nc"
    score = checked(capsys, "score", "r.nc", "scene.toml")
    assert score.hidden.surfaces == list(score.surfaces)
    assert {*score.hidden.surfaces} <= {surface.name for surface in truth.surface}
    assert 0 < score.points <= folded.points
    assert 0.0 < score.reachable_m <= sum(np.hypot(*np.subtract(s.start, s.end)) for s in truth.surface) + 0.01
    assert checked(capsys, "report", "r.nc", "-o", "r.html").bytes == (folder / "r.html").stat().st_size


@pytest.mark.parametrize(
    ("name", "kind"),
    [("sweep.nc", "sweep"), ("image.nc", "image"), ("reconstruction.nc", "reconstruction"), ("scene.toml", "scene")],
)
def test_info_of_each_kind(folder, capsys, name, kind):
    found = checked(capsys, "info", name)
    assert (found.path, found.kind) == (name, kind)


def test_info_of_a_sweep_that_cannot_be_used(folder, capsys, sweep):
    samples = sweep["s"].values.copy()
    samples[0, 0, :3] = np.nan
    sweep.assign(s=sweep["s"].copy(data=samples)).to_netcdf("nan.nc", engine="h5netcdf")
    found = checked(capsys, "info", "nan.nc", code=2)
    assert found.valid is False
    assert [finding.name for finding in found.findings] == ["nan"]


@pytest.mark.slow
def test_three_dimensions(folder, capsys):
    """A wall across the view, turned by 45 degrees, that shows a ball around the corner."""
    wall, half, radius = panel(width=0.8, height=0.8), np.radians(4.0), 0.15
    (folder / "space.toml").write_text(_toml(content(wall, ball(radius=radius), half=4.0, beams=15, points=801)))
    assert checked(capsys, "info", "space.toml").beams == [15, 15]
    cost = checked(capsys, "simulate", "space.toml", "--dry-run")
    assert (cost.beams, cost.frequencies, cost.sweep_bytes) == (225, 801, 8 * 225 * 801)
    # The ball stands 3 m away by way of the wall; what is seen of it is nearer by up to its radius.
    assert 3.0 - radius < cost.longest_return_m < 3.0
    assert cost.needed_frequencies == 1 + np.ceil(2 * 30e9 * cost.longest_return_m / speed_of_light)
    assert cost.scatterers >= cost.echoes > 1000
    checked(capsys, "simulate", "space.toml", "-o", "s.nc", "--force")
    assert checked(capsys, "info", "s.nc").dimensions == {"frequency": 801, "azimuth": 15, "elevation": 15}
    assert checked(capsys, "focus", "s.nc", "-o", "v.nc").kind == "image"
    folded = checked(capsys, "fold", "v.nc", "-o", "r.nc")
    score = checked(capsys, "score", "r.nc", "space.toml")
    assert 0 < score.points <= folded.points
    assert score.hidden.surfaces == list(score.surfaces) == ["ball"]
    # In the view, x + y = 2 m, tan(azimuth) = x / y, up to sqrt(x^2 + y^2) tan(half) above and below.
    x = 2.0 * np.tan(np.linspace(-half, half, 1001)) / (1.0 + np.tan(np.linspace(-half, half, 1001)))
    seen = np.trapezoid(2.0 * np.tan(half) * np.hypot(x, 2.0 - x), np.sqrt(2.0) * x)
    # Of the ball what faces the radar, 3 m from its middle, within 80 degrees: a - asin(r / d sin a) = t.
    steepest = np.arccos(0.17)
    cap = steepest - np.arcsin(radius / 3.0 * np.sin(steepest))
    assert score.hidden.reachable_m2 == pytest.approx(2.0 * np.pi * radius**2 * (1.0 - np.cos(cap)), rel=0.02)
    assert score.reachable_m2 - score.hidden.reachable_m2 == pytest.approx(seen, rel=0.03)


@pytest.mark.slow
def test_measured_data(folder, capsys):
    scan = checked(capsys, "export", "sweep.nc", "-o", "scan")
    back = checked(capsys, "import", "scan", "--positions", scan.positions, "-o", "back.nc")
    assert (back.tx, back.rx, back.frequencies) == (9, 9, 41)
    np.savez("image.npz", image=np.ones((5, 6)), x=np.arange(6) * 0.1, y=np.arange(5) * 0.1 + 1.0)
    image = checked(capsys, "import", "image.npz", "--image", "image", "-o", "foreign.nc")
    assert (image.kind, image.dimensions) == ("image", {"y": 5, "x": 6})
    np.savez("raw.npz", s=np.ones((11, 3, 4), complex), f=np.linspace(1e9, 2e9, 11))
    proposal = checked(capsys, "import", "raw.npz", "--guess")
    assert "frequency" in proposal.mapping
    assert (proposal.works, proposal.files) == ("", [])
    assert proposal.missing


@pytest.mark.slow
def test_full_waves_are_estimated(folder, capsys):
    found = checked(capsys, "simulate", "scene.toml", "--solver", "fullwave", "--dry-run")
    truth = mf.load_scene("scene.toml")
    length = sum(np.hypot(*np.subtract(surface.start, surface.end)) for surface in truth.surface)
    per_wavelength = found.unknowns * speed_of_light / truth.band.stop / length
    assert 4.0 < per_wavelength < 40.0
    assert found.skeletons <= found.unknowns
    assert found.frequencies == truth.band.points
    minutes = found.cpu_seconds_per_frequency * found.frequencies / found.workers / 60.0
    assert found.minutes == pytest.approx(minutes)
    assert found.memory_gb == pytest.approx(found.workers * found.memory_per_worker_gb)


@pytest.mark.slow
def test_plan_and_completion(folder, capsys):
    plan = checked(capsys, "plan", *PLAN)
    assert (plan.tx, plan.samples, plan.files) == (41, 41 * 41 * 101, [])
    for shell, word in (("bash", "complete"), ("zsh", "#compdef mirrorfold"), ("fish", "complete -c mirrorfold")):
        found = checked(capsys, "completion", shell)
        assert word in found.script
        for verb in VERBS:
            assert verb in found.script


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "posix_spawn"), reason="needs a POSIX shell")
def test_bash_completes_verbs_and_options(folder):
    script = folder / "completion.bash"
    script.write_bytes(subprocess.run([sys.executable, "-m", "mirrorfold", "completion", "bash"], capture_output=True,
                                      check=True).stdout)  # fmt: skip
    ask = (
        f"source {script}; COMP_WORDS=(mirrorfold {{words}}); COMP_CWORD=$((${{{{#COMP_WORDS[@]}}}} - 1)); "
        "_mirrorfold; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    for words, expected in (("recon", "reconstruct"), ("focus --tol", "--tolerance")):
        result = subprocess.run(["bash", "-c", ask.format(words=words)], capture_output=True, text=True, check=True)
        assert expected in result.stdout.split(), result


@pytest.mark.slow
def test_a_view_says_where_it_is(folder):
    """The page stays until it is interrupted; its address is one JSON object."""
    command = [sys.executable, "-m", "mirrorfold", "view", "reconstruction.nc", "--no-open", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith("}"):
                break
        process.terminate()
    assert check("view", "".join(lines)).address.startswith("http://127.0.0.1:")


@pytest.mark.slow
def test_a_benchmark(folder, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    (folder / "two_methods.py").write_text(
        "def nothing(image, sweep): return {'points': []}\n"
        "def point(image, sweep): return {'points': [[0.0, 1.0]]}\n"
        "def wrong(image, sweep): return 'wrong'\n"
    )
    found = checked(capsys, "benchmark", "--list")
    assert {"two walls", "corridor"} <= {family.name for family in found.families}
    assert found.radars[0].cell_m == pytest.approx(0.015, rel=1e-3)
    radar, family = RADARS["300 GHz"], FAMILIES["empty"]
    small = {"array": {**radar.array, "elements": 21}, "band": {**radar.band, "points": 41}}
    monkeypatch.setitem(RADARS, "small", replace(radar, name="small", **small))
    monkeypatch.setitem(FAMILIES, "small", replace(family, name="small"))
    methods = [f"two_methods:{name}" for name in ("nothing", "point", "wrong")]
    chosen = ["--family", "small", "--radar", "small", "--method", *methods, "--seeds", "3:5"]
    found = checked(capsys, "benchmark", *chosen, "-o", "out")
    assert found.seeds == [3, 4]
    assert [(one.scenes, one.failures) for one in found.results] == [(2, 0), (2, 0), (2, 2)]
    assert [one.figures["invented_cells"].mean for one in found.results] == [0.0, 1.0, None]
    assert found.files == [f"out/{name}" for name in ("scenes.jsonl", "table.csv", "table.json", "table.md",
                                                      "figures.png")]  # fmt: skip
    pair = [f"out:{method}" for method in methods[:2]]
    compared = checked(capsys, "benchmark", "compare", *pair, "-o", "d.png")
    assert compared.files == ["d.png"]
    by_name = {one.figure: one for one in compared.results[0].differences}
    assert (by_name["invented_cells"].difference, by_name["invented_cells"].verdict) == (1.0, "worse")


@pytest.mark.slow
def test_a_figure(folder, capsys):
    if "show" not in VERBS:
        pytest.skip("there is no verb show")
    assert checked(capsys, "show", "reconstruction.nc", "-o", "f.png", "--dpi", "40").files == ["f.png"]


@pytest.mark.slow
def test_options_have_the_same_names_everywhere(capsys):
    """What is written is -o, --output (of demo --out, a folder); all options are explained.

    Flags that are off by default have no opposite.
    """
    from mirrorfold.cli.program import app

    for verb in VERBS:
        arguments = app[verb].assemble_argument_collection(parse_docstring=True)
        names = {name for argument in arguments for name in argument.names}
        assert "--json" in names
        assert main([verb, "--help"]) == 0
        printed = capsys.readouterr().out
        assert not [word for word in printed.split() if word.startswith(("--no-json", "--empty"))]
        assert "--out" not in names or verb == "demo"
        assert ("--output" in names) == ("-o" in names)
        for argument in arguments:
            assert argument.parameter.help, f"{verb} does not explain {argument.names}"


def in_terminal(*arguments, cwd, **environment):
    """What the command writes to a terminal."""
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "mirrorfold", *arguments], cwd=cwd, stdout=follower, stderr=follower, stdin=follower,
        env={**os.environ, "TERM": "xterm-256color", **environment},
    )  # fmt: skip
    os.close(follower)
    pieces = []
    while True:
        try:
            piece = os.read(leader, 65536)
        except OSError:
            break
        if not piece:
            break
        pieces.append(piece)
    os.close(leader)
    assert process.wait() == 0
    return b"".join(pieces).decode("utf-8", "replace")


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [["score", "reconstruction.nc", "scene.toml"], ["plan", *PLAN], ["plan", "--help"]]
)
def test_pipes_get_plain_text(folder, arguments):
    """Rules, boxes and colours are for people only; NO_COLOR is honoured there too."""
    result = subprocess.run(
        [sys.executable, "-m", "mirrorfold", *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    assert result.stdout.isascii()
    assert "\x1b" not in result.stdout
    shown = in_terminal(*arguments, cwd=folder, NO_COLOR="1")
    assert "\u2500" in shown
    assert "\x1b[3" not in shown.replace("\x1b[3m", "")


@pytest.mark.slow
def test_progress_says_how_long_it_takes(folder):
    """In a terminal a bar with the time left; nobody else sees it."""
    shown = in_terminal("focus", "sweep.nc", "-o", "i.nc", cwd=folder)
    assert "focusing" in shown
    assert ":" in shown.partition("focusing")[2]


def _toml(scene):
    """Enough of TOML for the scenes of these tests."""

    def value(item):
        if isinstance(item, dict):
            return "{" + ", ".join(f"{key} = {value(part)}" for key, part in item.items()) + "}"
        return json.dumps(item)

    top = {key: item for key, item in scene.items() if key not in ("surface",)}
    lines = [f"{key} = {value(item)}" for key, item in top.items()]
    for surface in scene["surface"]:
        lines += ["[[surface]]", *(f"{key} = {value(item)}" for key, item in surface.items())]
    return "\n".join(lines) + "\n"
