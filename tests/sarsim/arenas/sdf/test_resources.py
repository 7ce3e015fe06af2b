"""Files that a world refers to: where they are looked for, and what is refused."""

import pytest

from pipeline.errors import InputError
from sarsim.arenas.sdf.build import build_sdf
from sarsim.arenas.sdf.resources import VARIABLES, Resources
from tests.sarsim.arenas.sdf.worlds import box, model, write


@pytest.fixture(autouse=True)
def no_model_folders(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def include(uri):
    return f"<include><uri>{uri}</uri></include>"


def refused(path, said):
    with pytest.raises(InputError, match=said) as error:
        build_sdf(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_models_are_looked_for_in_the_worlds_package_and_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("GAZEBO_MODEL_PATH", str(tmp_path / "shared"))
    places = ["pkg/worlds/a", "pkg/worlds/models/b", "pkg/models/c", "pkg/meshes/d", "shared/e"]
    for place in places:
        (tmp_path / place).mkdir(parents=True)
    resources, base = Resources(tmp_path / "pkg/worlds/w.sdf"), tmp_path / "pkg/worlds"
    uris = ["model://a", "model://b", "model://c", "package://pkg/meshes/d", "model://e"]
    assert [resources.find(uri, base, "") for uri in uris] == [tmp_path / place for place in places]
    assert resources.find("a", base, "") == resources.find("file://a", base, "") == tmp_path / "pkg/worlds/a"
    assert resources.find("model://f", base, "") is None
    assert resources.find("../c", tmp_path / "pkg/models/b", "") == tmp_path / "pkg/models/c"  # inside all the same
    assert resources.find("../f", tmp_path / "pkg/models/b", "") is None


@pytest.mark.parametrize(
    "uri", ["../secret.stl", "model://../secret.stl", "model://a/../../secret.stl", "file:///etc/passwd"]
)
def test_nothing_outside_the_folders_is_read(tmp_path, uri):
    (tmp_path / "secret.stl").write_text("solid")
    shape = f"<collision name='c'><geometry><mesh><uri>{uri}</uri></mesh></geometry></collision>"
    refused(write(tmp_path / "world", model("m", shape)), "refused, .* outside the folders")
    refused(write(tmp_path / "world", include(uri)), "refused, .* outside the folders")


def test_a_missing_mesh_or_model_is_named(tmp_path):
    shape = "<collision name='c'><geometry><mesh><uri>model://a/b.dae</uri></mesh></geometry></collision>"
    refused(write(tmp_path, model("m", shape)), "<collision> c: model://a/b.dae is in none of the folders")
    refused(write(tmp_path, include("model://pump")), "<include>: model://pump is in none of the folders")
    (tmp_path / "pump").mkdir()
    with pytest.raises(InputError, match=r"pump/model\.sdf"):
        build_sdf(write(tmp_path, include("model://pump")))


def test_a_circle_of_includes_is_refused(tmp_path):
    for a, b in ("ab", "ba"):
        (tmp_path / a).mkdir()
        inside = f"<model name='{a}'>{include(f'model://{b}')}</model>"
        (tmp_path / a / "model.sdf").write_text(f"<sdf version='1.9'>{inside}</sdf>")
    with pytest.raises(InputError, match=r"a/model\.sdf .*itself"):
        build_sdf(write(tmp_path, include("model://a")))


def test_includes_that_double_endlessly_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("sarsim.arenas.sdf.world.MOST_GEOMS", 100)
    for level in range(20):
        (tmp_path / f"m{level}").mkdir()
        inside = 2 * include(f"model://m{level + 1}") if level < 19 else ""
        (tmp_path / f"m{level}" / "model.sdf").write_text(f"<sdf><model name='m'>{inside}</model></sdf>")
    with pytest.raises(InputError, match=r"models, .*100"):
        build_sdf(write(tmp_path, include("model://m0")))


def test_deep_nesting_is_refused(tmp_path):
    path = tmp_path / "a.sdf"
    path.write_text("<sdf>" + "<model name='m'>" * 3000 + "</model>" * 3000 + "</sdf>")
    refused(path, "nested too deeply|not readable XML")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<sdf><world>", "not readable XML"),
        ("<sdf version='1.2'><model><link><origin pose='0 0 0 0 0 0'/></link></model></sdf>", "before 1.3"),
        ("<mujoco/>", "not an SDF file: its root is <mujoco>, not <sdf>"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><sdf>&b;</sdf>", "declares a document type or entities"),
        (f"<sdf>{model('m', box('nan', 1, 1))}</sdf>", "<collision> c, <size>: 'nan 1 1' is not 3 numbers"),
        (f"<sdf>{model('m', box(1, 1, 1), pose='0 0 nan 0 0 0')}</sdf>", "<pose>: '0 0 nan 0 0 0' is not 6 numbers"),
        (f"<sdf>{model('m', box(1, -1, 1))}</sdf>", "<collision> c: <box> has a negative size"),
    ],
)
def test_broken_files_are_one_line(tmp_path, text, said):
    path = tmp_path / "a.sdf"
    path.write_text(text)
    refused(path, said)
