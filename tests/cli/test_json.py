"""What verbs print with ``--json`` is what `mirrorfold schema` promises, field by field."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys

import numpy as np
import pydantic
import pytest
from scans import ball, content, panel

import mirrorfold as mf
from mirrorfold.cli import VERBS, main
from mirrorfold.cli.schema import OUTPUTS, check, describe_fields, json_schema, models, outputs

PLAN = ["--band", "270e9:300e9", "--points", "101", "--aperture", "0.02", "--pitch", "0.5e-3", "--range", "1"]


@pytest.fixture
def folder(tmp_path, monkeypatch, sweep, image, reconstruction, scene_file):
    monkeypatch.chdir(tmp_path)
    mf.save(sweep, "sweep.nc")
    mf.save(image, "image.nc")
    mf.save(reconstruction, "reconstruction.nc")
    return tmp_path


def checked(capsys, verb, *arguments, code=0):
    """The model of what a verb prints, which must be all that it prints, and hold every field that is printed."""
    assert main([verb, *arguments, "--json"]) == code
    printed = capsys.readouterr().out
    found = check(verb, printed)
    assert set(json.loads(printed)) <= set(type(found).model_fields)
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
        assert all(kind != "anything" for _, kind, _ in describe_fields(model))


def test_a_field_that_is_not_promised_is_refused():
    with pytest.raises(pydantic.ValidationError):
        check("view", '{"kind": "view", "address": "http://127.0.0.1:1", "more": 1}')
    with pytest.raises(pydantic.ValidationError):
        check("completion", '{"kind": "completion", "shell": "bash"}')


def test_the_chain_from_a_scene_to_a_score(folder, capsys):
    assert checked(capsys, "simulate", "scene.toml", "-o", "s.nc").files == ["s.nc"]
    assert checked(capsys, "calibrate", "s.nc", "-o", "c.nc", "--gate", "0.1:").processing[-1]
    assert checked(capsys, "focus", "c.nc", "-o", "i.nc", "--x", "-0.25:0.25:0.005", "--y", "0.2:0.45:0.005").type
    assert checked(capsys, "fold", "i.nc", "-o", "r.nc").files == ["r.nc"]
    assert checked(capsys, "reconstruct", "s.nc", "-o", "out").kind == "reconstruction"
    score = checked(capsys, "score", "r.nc", "scene.toml")
    assert score.hidden.surfaces is not None
    assert checked(capsys, "report", "r.nc", "-o", "r.html").bytes > 1000


@pytest.mark.parametrize("name", ["sweep.nc", "image.nc", "reconstruction.nc", "scene.toml"])
def test_info_of_each_kind(folder, capsys, name):
    assert checked(capsys, "info", name).path == name


def test_info_of_a_sweep_that_cannot_be_used(folder, capsys, sweep):
    samples = sweep["s"].values.copy()
    samples[0, 0, :3] = np.nan
    sweep.assign(s=sweep["s"].copy(data=samples)).to_netcdf("nan.nc", engine="h5netcdf")
    found = checked(capsys, "info", "nan.nc", code=2)
    assert not found.valid
    assert found.findings


def test_three_dimensions(folder, capsys):
    wall = panel(width=0.8, height=0.8)
    scene = content(wall, ball(), half=4.0, beams=15, points=201)
    path = folder / "space.toml"
    path.write_text(_toml(scene))
    assert checked(capsys, "info", "space.toml").beams == [15, 15]
    assert checked(capsys, "simulate", "space.toml", "--dry-run").echoes >= 0
    checked(capsys, "simulate", "space.toml", "-o", "s.nc", "--force")
    assert checked(capsys, "info", "s.nc").beams == [15, 15]
    checked(capsys, "focus", "s.nc", "-o", "v.nc")
    checked(capsys, "fold", "v.nc", "-o", "r.nc")
    assert checked(capsys, "score", "r.nc", "space.toml").reachable_m2 >= 0


def test_measured_data(folder, capsys):
    scan = checked(capsys, "export", "sweep.nc", "-o", "scan")
    back = checked(capsys, "import", "scan", "--positions", scan.positions, "-o", "back.nc")
    assert back.tx == 9
    np.savez("image.npz", image=np.ones((5, 6)), x=np.arange(6) * 0.1, y=np.arange(5) * 0.1 + 1.0)
    assert checked(capsys, "import", "image.npz", "--image", "image", "-o", "foreign.nc").kind == "image"
    np.savez("raw.npz", s=np.ones((11, 3, 4), complex), f=np.linspace(1e9, 2e9, 11))
    assert checked(capsys, "import", "raw.npz", "--guess").mapping


def test_full_waves_are_estimated(folder, capsys):
    assert checked(capsys, "simulate", "scene.toml", "--solver", "fullwave", "--dry-run").unknowns > 0


def test_plan_and_completion(folder, capsys):
    assert checked(capsys, "plan", *PLAN).samples > 0
    for shell, word in (("bash", "complete"), ("zsh", "#compdef mirrorfold"), ("fish", "complete -c mirrorfold")):
        found = checked(capsys, "completion", shell)
        assert word in found.script
        for verb in VERBS:
            assert verb in found.script


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


def test_a_figure(folder, capsys):
    if "show" not in VERBS:
        pytest.skip("there is no verb show")
    assert checked(capsys, "show", "reconstruction.nc", "-o", "f.png", "--dpi", "40").files == ["f.png"]


@pytest.mark.slow
def test_the_demonstration(folder, capsys):
    assert checked(capsys, "demo", "--out", "shown").hidden.f_score_2cm > 0.9


def test_options_have_the_same_names_everywhere(capsys):
    """What is written is -o, --output (of demo --out, a folder); flags have no opposite; all options are explained."""
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
