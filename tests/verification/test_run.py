"""Whole runs are found whole, whatever they are of; what is wrong with a broken one is said."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.verification.runs import Glb, Ply, edit_report, make_run, seal, write_report
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names
from weathercoat.errors import AccessError, CheckError
from weathercoat.mesh.shapes import make_barrel, make_box, make_plate, make_sign
from weathercoat.mesh.surface import Surface
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset
from weathercoat.verification.run import Verification, verify_run

SMALL = ("remesh.faces=300", "ageing.steps=30", "output.preview=false")
LAST = "snapshots/step_0060"
Edit = Callable[[Path], None]


def test_a_finished_run_is_whole(finished: Path) -> None:
    found = verify_run(finished)
    assert found.findings == () and found.is_whole and found.unproved == ()
    files = [path for path in finished.rglob("*") if path.is_file() and path.name != "timing.json"]
    assert (found.files, found.snapshots) == (len(files), 3) and found.checks > 300
    assert edit_report(finished)["snapshots"][-1]["flakes"]["count"] > 20


@pytest.mark.parametrize("config", preset_names())
def test_runs_of_every_shipped_config_are_whole(tmp_path: Path, config: str) -> None:
    assert verify_run(make_run(tmp_path / "run", make_sign(), config, *SMALL)).findings == ()


@pytest.mark.parametrize(
    ("surface", "overrides"),
    [
        pytest.param(make_barrel(), ("snapshots.steps=[0, 1, 2, 3, 30]",), id="closed, from the start"),
        pytest.param(make_plate(), ("remesh=off",), id="open, as it is"),
        pytest.param(make_box(), ("remesh=off", "deformation.solver=newton"), id="coarse, converged"),
        pytest.param(make_sign(), ("appearance.thickness=0",), id="a sheet"),
        pytest.param(make_sign(), ("ageing.duration=1e-9",), id="short"),
        pytest.param(make_barrel(), ("model.up=-x",), id="lying"),
        pytest.param(make_barrel(), ("model.up=[0.3, -0.5, 0.2]",), id="leaning upside down"),
        pytest.param(make_barrel(), ("deformation.solver=none", "flaking.rule=faces"), id="not curling"),
    ],
)
def test_runs_of_all_kinds_are_whole(tmp_path: Path, surface: Surface, overrides: tuple[str, ...]) -> None:
    assert verify_run(make_run(tmp_path / "run", surface, "crackle", *SMALL, *overrides)).findings == ()


@pytest.mark.parametrize(("format", "missing"), [("ply", "agree"), ("glb", "half-edges and planes")])
def test_a_run_in_one_format_is_proved_as_far_as_it_goes(tmp_path: Path, format: str, missing: str) -> None:
    found = verify_run(
        make_run(tmp_path / "run", make_sign(), "crackle", *SMALL, f"output.formats=[{format}]")
    )
    assert found.findings == () and found.snapshots == 5
    assert len(found.unproved) == 1 and missing in found.unproved[0]


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_tolerances_follow_unit_and_place(tmp_path: Path, scale: float, offset: float) -> None:
    sign = make_sign()
    moved = Surface((sign.vertices + offset) * scale, sign.faces, sign.face_group, sign.groups)
    assert verify_run(make_run(tmp_path / "run", moved, "crackle", *SMALL)).findings == ()


def test_the_checker_loads_nothing_that_writes_runs() -> None:
    program = "import sys, weathercoat.verification.run; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    own = {name for name in loaded.stdout.split() if name.startswith("weathercoat.")}
    assert {name for name in own if not name.startswith("weathercoat.verification")} == {"weathercoat.errors"}


def test_bits_that_flip_anywhere_are_found_by_the_hashes(run: Path) -> None:
    random = np.random.default_rng(1)
    for name in edit_report(run)["files"]:
        path = run / name
        whole = path.read_bytes()
        for place in random.integers(0, len(whole), 4):
            broken = bytearray(whole)
            broken[place] ^= 1 << int(random.integers(8))
            path.write_bytes(broken)
            found = verify_run(run)
            assert ("hashes", name) in {(finding.check, finding.file) for finding in found.findings}
        path.write_bytes(whole)
    assert verify_run(run).is_whole


def set_vertex(name: str, row: int, value: Any, *, of_film: bool = True, file: str = LAST) -> Edit:
    """Set a property of a vertex of the film, or of the metal."""

    def edit(run: Path) -> None:
        ply = Ply(run / f"{file}.ply")
        ply.vertex[name][row + ply.metal * of_film] = value
        ply.save()

    return edit


def set_film_face(edit_row: Callable[[Any, Ply], None], row: int = 12) -> Edit:
    """Change a face of the film, given as its row of the table."""

    def edit(run: Path) -> None:
        ply = Ply(run / f"{LAST}.ply")
        edit_row(ply.face[ply.metal_faces + row : ply.metal_faces + row + 1], ply)
        ply.save()

    return edit


def set_corner(value: int) -> Callable[[Any, Ply], None]:
    def edit(row: Any, ply: Ply) -> None:
        row["corners"][0, 1] = value

    return edit


def swap_corners(row: Any, ply: Ply) -> None:
    row["corners"][0] = row["corners"][0, [1, 0, 2]]


def repeat_face(row: Any, ply: Ply) -> None:
    ply.face[-1] = row[0]


def sink(run: Path) -> None:
    """Move a separated vertex of the film a tenth of a millionth below its plane."""
    ply = Ply(run / f"{LAST}.ply")
    film = ply.vertex[ply.metal :]
    row = np.flatnonzero(film["separated"])[3]
    metal = ply.vertex[film["origin"][row]]
    hair = float(next(line for line in ply.header.decode().splitlines() if " hair " in line).split()[-1])
    for axis, normal in zip("xyz", ("nx", "ny", "nz"), strict=True):
        film[axis][row] = metal[axis] + (hair - 1e-7) * metal[normal]
    ply.save()


def shift_attached(run: Path) -> None:
    ply = Ply(run / f"{LAST}.ply")
    film = ply.vertex[ply.metal :]
    film["x"][np.flatnonzero(film["separated"] == 0)[5]] += 1e-8
    ply.save()


def weld(run: Path) -> None:
    """Let the film on one side of a crack use a vertex of the other side, where no edge comes together."""
    ply = Ply(run / f"{LAST}.ply")
    faces = ply.face[ply.metal_faces :]["corners"]
    origin = ply.vertex["origin"]
    for one in range(ply.metal, len(ply.vertex)):
        for other in range(one + 1, len(ply.vertex)):
            if origin[one] == origin[other]:
                around = [set(faces[(faces == v).any(axis=1)].ravel().tolist()) for v in (one, other)]
                if not around[0] & around[1]:
                    faces[faces == other] = one
                    ply.save()
                    return
    pytest.fail("nothing to weld")


def drop_face(run: Path) -> None:
    ply = Ply(run / f"{LAST}.ply")
    ply.face = ply.face[:-1]
    ply.save()


def put_earlier(run: Path) -> None:
    """Give the second snapshot the film of the last, so that the last seems to follow the first: film that is
    not in the second comes back in none, but what the third has lost later than that is not there."""
    first, last = (run / f"snapshots/step_00{step}.ply" for step in (20, 60))
    content = (
        last.read_bytes().replace(b"step 60", b"step 20", 1).replace(b"age 1.0", b"age 0.3333333333333333")
    )
    first.write_bytes(content)


def remove(name: str) -> Edit:
    return lambda run: (run / name).unlink()


def cut(name: str, share: float) -> Edit:
    def edit(run: Path) -> None:
        path = run / name
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])

    return edit


def replace(name: str, old: bytes, new: bytes) -> Edit:
    def edit(run: Path) -> None:
        content = (run / name).read_bytes()
        assert old in content
        (run / name).write_bytes(content.replace(old, new, 1))

    return edit


def set_attribute(node: str, name: str, row: int, value: float, sheet: int = 0) -> Edit:
    def edit(run: Path) -> None:
        glb = Glb(run / f"{LAST}.glb")
        primitive = glb.primitive(node, sheet)
        number = primitive["indices"] if name == "indices" else primitive["attributes"][name]
        glb.array(number)[row] = value
        glb.save()

    return edit


def set_accessor(key: str, change: Callable[[Any], Any]) -> Edit:
    """Change what the accessor of the metal's positions says."""

    def edit(run: Path) -> None:
        glb = Glb(run / f"{LAST}.glb")
        accessor = glb.document["accessors"][glb.primitive("substrate")["attributes"]["POSITION"]]
        accessor[key] = change(accessor[key])
        glb.save()

    return edit


def set_role(document: dict[str, Any], role: str, other: str) -> None:
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            if primitive["extras"]["role"] == role:
                primitive["extras"]["role"] = other


def set_glb(change: Callable[[dict[str, Any]], None]) -> Edit:
    def edit(run: Path) -> None:
        glb = Glb(run / f"{LAST}.glb")
        change(glb.document)
        glb.save()

    return edit


def lift_bound(bounds: list[float]) -> list[float]:
    return [bounds[0], float(np.nextafter(np.float32(bounds[1]), np.float32(9))), bounds[2]]


def set_sheet(edit_table: Callable[[Ply], None]) -> Edit:
    def edit(run: Path) -> None:
        ply = Ply(run / "untouched.ply")
        edit_table(ply)
        ply.save()

    return edit


def nudge_sheet(ply: Ply) -> None:
    ply.vertex["y"][1] = np.inf


def misdirect_sheet(ply: Ply) -> None:
    ply.face["corners"][0, 2] = -1


@pytest.mark.parametrize(
    ("edit", "check", "message"),
    [
        (
            set_film_face(set_corner(99_999)),
            "indices",
            r"film face 12 has index 99999, but there are \d+ vert",
        ),
        (set_film_face(set_corner(-7)), "indices", "film face 12 has index -7, but there are"),
        (set_film_face(set_corner(3)), "indices", "film face 12 has index 3, which is metal vertex 3"),
        (set_film_face(swap_corners), "film-over-metal", r"film face 12 has corners of the origins \d+, "),
        (set_film_face(repeat_face), "film-once", "2 film faces lie over metal face"),
        (drop_face, "counts", r"holds \d+ film_faces, but run.json says"),
        (weld, "film-manifold", r"film vertex \d+ joins 2 fans, as if welded across a crack"),
        (weld, "film-used", r"film vertex \d+ is of no face"),
        (set_vertex("x", 5, np.nan), "finite", "film vertex 5 has position .*, which is not finite"),
        (set_vertex("ny", 5, np.inf, of_film=False), "finite", "metal vertex 5 has normal"),
        (set_vertex("nz", 5, 3.0), "unit-normals", r"the normal of film vertex 5 has the length [34]"),
        (sink, "above-plane", r"film vertex \d+ is 1e-07 below the tangent plane of metal vertex \d+"),
        (shift_attached, "attached", r"film vertex \d+ is attached, but 1e-08 off the metal"),
        (set_vertex("part", 5, 0), "parts", "its parts are not first metal"),
        (set_vertex("origin", 5, 10**6), "origins", "film vertex 5 has origin 1000000, but there are"),
        (set_vertex("origin", 5, 4, of_film=False), "origins", "metal vertex 5 has origin 4, not its own"),
        (set_vertex("rust", 5, 1.5), "ranges", "film vertex 5 has rust 1.5, which is not within 0 and 1"),
        (set_vertex("dust", 7, -0.5, of_film=False), "ranges", "metal vertex 7 has dust -0.5"),
        (set_vertex("dust", 7, 0.5), "dust-alike", "film vertex 7 has other dust than the metal"),
        (set_vertex("separated", 5, 2), "ranges", "film vertex 5 has separated 2, which is not 0 or 1"),
        (set_vertex("separated", 5, 1, of_film=False), "ranges", "metal vertex 5 is separated"),
        (set_vertex("bare", 5, 1), "ranges", "film vertex 5 is bare"),
        (set_vertex("adhesion", 5, -1.0), "ranges", "film vertex 5 has adhesion -1.0"),
        (set_vertex("separation_age", 5, 1.1), "ranges", "film vertex 5 has separation age 1.1"),
        (set_vertex("x", 9, 0.25, of_film=False), "metal-unchanged", "metal vertex 9 is not where it was"),
        (put_earlier, "lost-stays-lost", r"film over metal face \d+, which had lost it"),
        (put_earlier, "separated-stays-separated", "holds again"),
        (remove(f"{LAST}.ply"), "files-expected", "follows from run.json, but is not listed"),
        (remove("preview.png"), "files-expected", "follows from run.json, but is not listed"),
        (cut(f"{LAST}.ply", 0.7), "ply", r"the header asks for [\d,]+ bytes, the file holds"),
        (cut(f"{LAST}.ply", 0.001), "ply", "no binary little-endian PLY"),
        (cut(f"{LAST}.glb", 0.7), "glb", r"its header says [\d,]+ bytes, the file holds"),
        (cut("preview.png", 0.7), "preview", "ends within a chunk"),
        (cut("untouched.ply", 0.9), "untouched", "the header asks for"),
        (replace(f"{LAST}.ply", b"element vertex ", b"element vertex 9999999"), "ply", "the header asks for"),
        (replace(f"{LAST}.ply", b"age 1.0", b"age 1.5"), "time", "is of step 60, age 1.5, but run.json says"),
        (replace(f"{LAST}.ply", b"hair ", b"hair 1"), "metal-unchanged", "the hair is"),
        (replace(f"{LAST}.ply", b"float rust", b"float dirt"), "ply", "not those of a snapshot"),
        (replace("preview.png", b"IDAT", b"IDAS"), "preview", "the chunk 'IDAS' fails its check sum"),
        (set_attribute("film", "COLOR_0", 3, 1.5), "glb-ranges", "COLOR_0 runs from .* to 1.5, not within"),
        (set_attribute("film", "COLOR_0", 3, 0.99), "formats-agree", "paint: the colour of vertex 1 is not"),
        (set_attribute("film", "_RUST", 3, 0.99), "formats-agree", "paint: _RUST of vertex 3 is not that of"),
        (set_attribute("film", "_SEPARATION_AGE", 3, 1.1), "glb-ranges", "film, paint: _SEPARATION_AGE runs"),
        (set_attribute("film", "POSITION", 3, np.nan), "glb-finite", "film, paint: POSITION of vertex 1 is"),
        (set_attribute("film", "POSITION", 3, 0.01, sheet=1), "formats-agree", r"primer: vertex 1 is .* off"),
        (set_attribute("film", "NORMAL", 3, 4.0), "glb-normals", "film, paint: the normal of vertex 1 has"),
        (set_attribute("substrate", "indices", 5, 10**6), "glb-indices", "metal: face 1 has index 1000000"),
        (set_attribute("substrate", "indices", 5, 0), "formats-agree", "metal: .*of the PLY"),
        (set_accessor("max", lift_bound), "glb-bounds", "substrate, metal: positions lie within"),
        (
            set_accessor("count", lambda count: 10**12),
            "glb",
            r"with 1,000,000,000,000 entries does not lie in",
        ),
        (set_accessor("componentType", lambda kind: 5123), "glb", "holds not what it is used for"),
        (set_glb(lambda d: d["asset"]["extras"].update(step=61)), "time", "is of step 61, age 1.0, but"),
        (set_glb(lambda d: d["nodes"][0].update(translation=[1, 2])), "glb", "moved by no 3 numbers"),
        (set_glb(lambda d: set_role(d, "film", "fim")), "glb-counts", "the film has"),
        (set_glb(lambda d: d.update(buffers=[])), "glb", r"its buffer is not the [\d,]+ bytes of the binary"),
        (set_glb(lambda d: d.update(nodes=[])), "glb", "its nodes are no tree"),
        (set_glb(lambda d: set_role(d, "untouched", "rim")), "glb-counts", "have 0 faces instead of 1"),
        (set_sheet(nudge_sheet), "finite", "the position of vertex 1 is not finite"),
        (set_sheet(misdirect_sheet), "indices", r"face 0 has corners \[0, 1, -1\], but there are 3"),
    ],
)
def test_what_is_wrong_is_found_by_the_content_alone(run: Path, edit: Edit, check: str, message: str) -> None:
    edit(run)
    seal(run)
    found = verify_run(run)
    told = [str(finding) for finding in found.findings if finding.check == check]
    assert told, found.findings
    assert any(re.search(message, line) for line in told), told


@pytest.mark.parametrize(
    "key",
    [
        *("separated_share", "lost_area", "lost_share", "affected_share", "crack_length", "outline_length"),
        *("film_rust", "substrate_rust", "dust", "flakes.area", "film_faces", "age"),
    ],
)
@pytest.mark.parametrize("change", [1e-3, -1e-6])
def test_figures_are_computed_again(run: Path, key: str, change: float) -> None:
    report = edit_report(run)
    row = report["snapshots"][1]
    *above, last = key.split(".")
    for name in above:
        row = row[name]
    assert row[last] > 0
    row[last] = row[last] + 1 if isinstance(row[last], int) else row[last] * (1.0 + change)
    write_report(run, report)
    assert any(key.split(".")[0] in str(finding) for finding in verify_run(run).findings)


@pytest.mark.parametrize("key", ["area", "diagonal", "faces", "vertices", "mean_length", "boundary_length"])
def test_figures_of_the_metal_are_computed_again(run: Path, key: str) -> None:
    report = edit_report(run)
    film = report["meshes"]["film"]
    inner = film["edges"] if key in film["edges"] else film
    inner[key] += 1e-3 if isinstance(inner[key], float) else 1
    write_report(run, report)
    told = [finding for finding in verify_run(run).findings if finding.check == "metal-figures"]
    assert len(told) == 1 and key in told[0].message and told[0].file == "run.json"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("count", 3),
        ("median_area", 1e9),
        ("largest_area", 0.0),
        ("largest_areas", [1.0]),
        ("largest_areas", ["x"]),
    ],
)
def test_flakes_that_contradict_each_other_are_found(run: Path, key: str, value: Any) -> None:
    report = edit_report(run)
    report["snapshots"][2]["flakes"][key] = value
    write_report(run, report)
    assert any("flakes" in finding.message for finding in verify_run(run).findings)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no valid JSON"),
        (b"[]", "no JSON object"),
        (b'{"report_version": NaN}', "NaN is no number of JSON"),
        (b"[" * 100_000, "no valid JSON"),
        (b'{"report_version": ' + b"9" * 10_000 + b"}", "no valid JSON"),
        (b"\xff\xfe", "no valid JSON"),
        (b"{}", "holds no files"),
        (b'{"files": {}, "report_version": 2}', "is of version 2, and 1 is known"),
        (b'{"files": {"a": "b"}}', "the SHA-256 of 'a' in files is 'b'"),
    ],
)
def test_a_broken_report_is_a_finding(run: Path, content: bytes, message: str) -> None:
    (run / "run.json").write_bytes(content)
    (finding,) = verify_run(run).findings
    assert finding.file == "run.json" and finding.check == "report" and message in finding.message


def test_files_that_are_missing_or_strange_are_found(run: Path) -> None:
    (run / "preview.png").unlink()
    (run / "notes.txt").write_text("mine")
    (run / "snapshots" / "step_0070.ply").write_text("")
    os.mkfifo(run / "pipe")
    (run / "away").symlink_to("/")
    (run / "nowhere").symlink_to("missing")
    assert {(finding.check, str(finding)) for finding in verify_run(run).findings} == {
        ("files-there", "preview.png: is listed in run.json, but missing"),
        ("files-listed", "notes.txt: is not listed in run.json"),
        ("files-listed", "snapshots/step_0070.ply: is not listed in run.json"),
        ("files-listed", "pipe: is neither a file nor a folder"),
        ("files-listed", "away: is neither a file nor a folder"),
        ("files-listed", "nowhere: is neither a file nor a folder"),
    }


@pytest.mark.parametrize(
    ("step", "age", "told"),
    [
        (20, 0.4, "the age of step 20 is 0.4, which is"),
        (70, 0.5, "are not among"),
        (10**400, 0.5, "of no such step"),
        (10, 0.5, "do not rise"),
    ],
)
def test_steps_and_ages_follow_the_config(run: Path, step: int, age: float, told: str) -> None:
    report = edit_report(run)
    report["snapshots"][0 if step == 20 else 1].update(step=step, age=age)
    write_report(run, report)
    assert any(told in str(finding) for finding in verify_run(run).findings)


def test_a_snapshot_of_no_row_is_found(run: Path) -> None:
    shutil.copy(run / f"{LAST}.ply", run / "snapshots" / "step_0070.ply")
    seal(run)
    (finding,) = verify_run(run).findings
    assert str(finding) == "snapshots/step_0070.ply: is of no snapshot of run.json"


def test_a_listed_path_outside_of_the_folder_is_not_read(run: Path) -> None:
    report = edit_report(run)
    report["files"]["../outside"] = hashlib.sha256(b"x").hexdigest()
    (run.parent / "outside").write_bytes(b"x")
    write_report(run, report)
    assert [str(finding) for finding in verify_run(run).findings] == [
        "../outside: is listed in run.json, but missing"
    ]


def test_no_run_is_an_error(tmp_path: Path, run: Path) -> None:
    for folder in (tmp_path / "missing", tmp_path):
        with pytest.raises(AccessError):
            verify_run(folder)
    (run / "run.json").unlink()
    os.mkfifo(run / "run.json")
    with pytest.raises(AccessError):
        verify_run(run)


def test_random_mutations_never_raise(finished: Path, run: Path) -> None:
    random = np.random.default_rng(5)
    names = [name for name in edit_report(finished)["files"] if not name.startswith("checkpoint/")]
    names += ["run.json"]
    missed = 0
    for number in range(200):
        name = names[random.integers(len(names))] if number % 3 else "run.json"
        content = bytearray((finished / name).read_bytes())
        start = int(random.integers(len(content)))
        stop = min(len(content), start + int(random.integers(1, 9)))
        kind = random.integers(5)
        if kind == 0:
            del content[start:stop]
        elif kind == 1:
            content[start:stop] = random.bytes(stop - start)
        elif kind == 2:
            del content[start:]
        elif kind == 3:
            content[start:start] = content[: stop - start]
        else:
            content[start] ^= 1 << int(random.integers(8))
        (run / name).write_bytes(content)
        if name != "run.json":
            seal(run)
        found = verify_run(run)
        assert isinstance(found, Verification)
        missed += found.is_whole and bytes(content) != (finished / name).read_bytes()
        for kept in {name, "run.json"}:
            shutil.copy(finished / kept, run / kept)
    assert verify_run(run).is_whole
    # What the config says and what no file tells again, such as energies, may change unseen in run.json.
    assert missed < 60


def values_of(content: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The places of all values in JSON."""
    inner = (
        content.items()
        if isinstance(content, dict)
        else enumerate(content)
        if isinstance(content, list)
        else ()
    )
    return [place] * bool(place) + [
        found for key, value in inner for found in values_of(value, (*place, key))
    ]


def test_no_value_of_the_report_or_of_a_glb_is_trusted(run: Path) -> None:
    random = np.random.default_rng(6)
    glb = Glb(run / f"{LAST}.glb")
    strange = [None, True, -1, 10**400, 1e308, "", "x", [], [[]], {}, {"a": 1}]
    for number in range(150):
        content = edit_report(run) if number % 2 else json.loads(json.dumps(glb.document))
        places = values_of(content)
        place = places[random.integers(len(places))]
        inner = content
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = strange[random.integers(len(strange))]
        report = (run / "run.json").read_bytes()
        if number % 2:
            write_report(run, content)
        else:
            broken = Glb(glb.path)
            broken.document = content
            broken.save()
            seal(run)
        assert isinstance(verify_run(run), Verification)
        glb.save()
        (run / "run.json").write_bytes(report)


def test_a_result_that_is_not_whole_is_not_put_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from weathercoat import recording
    from weathercoat.output.report import measure_snapshot

    def measure_wrongly(*arguments: Any, **more: Any) -> dict[str, Any]:
        return measure_snapshot(*arguments, **more) | {"dust": 0.5}

    monkeypatch.setattr(recording, "measure_snapshot", measure_wrongly)
    write_mesh(tmp_path / "sign.obj", make_sign())
    loaded = load_config("standard", [*SMALL, "snapshots.count=1"])
    with pytest.raises(
        CheckError, match=r"fails its checks: run\.json: dust of step 30 is 0\.5, but"
    ) as caught:
        run_asset(loaded, tmp_path / "sign.obj", tmp_path / "out")
    assert caught.value.exit_code == 6 and caught.value.file == "sign.obj"
    assert [path.name for path in tmp_path.iterdir()] == ["sign.obj"]
    report = run_asset(loaded, tmp_path / "sign.obj", tmp_path / "out", check=False)
    assert report["timing"]["around"]["check"] == 0.0
