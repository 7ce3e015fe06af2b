"""Files that a world refers to: where they are looked for, and what is refused."""

import pytest

from pipeline.errors import InputError
from sarsim.arenas.sdf.build import build_sdf
from sarsim.arenas.sdf.model_folders import model_file
from sarsim.arenas.sdf.resources import PATH_VARIABLES, Resources
from sarsim.arenas.sdf.world import SdfWorld
from tests.sarsim.arenas.sdf.worlds import box, model, write


@pytest.fixture(autouse=True)
def no_model_folders(monkeypatch):
    for name in PATH_VARIABLES:
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
    refused(write(tmp_path / "world", model("m", shape)), "refused because .* outside the folders")
    refused(write(tmp_path / "world", include(uri)), "refused because .* outside the folders")


def put(path, content=""):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)
    return path


def test_names_are_the_same_in_either_case_and_may_have_spaces(tmp_path):
    path = put(tmp_path / "My Model" / "Meshes" / "A b.DAE")
    resources = Resources(tmp_path / "w.sdf")
    for uri in (
        "model://my model/meshes/a b.dae",
        "model://My%20Model/Meshes/A%20b.DAE",
        "My Model\\Meshes\\A b.DAE",
    ):
        assert resources.find(uri, tmp_path, "") == path
    assert resources.find("model://my model/meshes/c.dae", tmp_path, "") is None


def test_a_file_is_looked_for_around_the_one_that_names_it(tmp_path):
    mesh_file, other = (
        put(tmp_path / "sets" / "new" / "tree" / "a.stl"),
        put(tmp_path / "sets" / "new" / "leaf" / "b.stl"),
    )
    resources, base = Resources(tmp_path / "w.sdf"), mesh_file.parent
    assert resources.find("model://tree/a.stl", base, "") == mesh_file
    assert resources.find("model://leaf/b.stl", base, "") == other
    assert resources.find("model://its_old_name/a.stl", base, "") == mesh_file


def test_an_absolute_path_of_another_machine_is_looked_for_by_its_end(tmp_path):
    path = put(tmp_path / "models" / "tree" / "a.stl")
    resources = Resources(tmp_path / "w.sdf")
    for uri in (f"file://{path}", str(path), "file:///home/somebody/.gazebo/models/tree/a.stl", "/tree/a.stl"):
        assert resources.find(uri, tmp_path, "") == path
    lines = write(tmp_path, model("m", box(1, 1, 1)), include("file:///etc/passwd"))
    assert "outside the folders" in "".join(said(lines))


def said(path):
    world = SdfWorld(path)
    list(world.shapes())
    return world.errors


def test_a_package_is_known_by_its_name_whatever_its_folder_is_called(tmp_path):
    package = tmp_path / "downloaded-main"
    put(package / "package.xml", "<package><name>office</name></package>")
    path, other = put(package / "meshes" / "a.stl"), put(package / "models" / "tree" / "b.stl")
    for world in (package / "worlds" / "w.sdf", package / "worlds" / "new" / "w.sdf"):
        resources = Resources(world)
        for uri in ("package://office/meshes/a.stl", "model://office/meshes/a.stl", "model://meshes/a.stl"):
            assert resources.find(uri, world.parent, "") == path
        assert resources.find("model://tree/b.stl", world.parent, "") == other


def test_packages_beside_the_worlds_and_their_media_are_looked_into(tmp_path, monkeypatch):
    for name in ("worlds", "elements"):
        put(tmp_path / "src" / name / "package.xml", f"<package><name>{name}</name></package>")
    here = put(tmp_path / "src" / "elements" / "Media" / "models" / "wall.dae")
    secret, named = (
        put(tmp_path / "src" / "other" / "secret.dae"),
        put(tmp_path / "gz" / "media" / "models" / "b.dae"),
    )
    monkeypatch.setenv("GAZEBO_RESOURCE_PATH", str(tmp_path / "gz"))
    base = tmp_path / "src" / "worlds" / "worlds"
    resources = Resources(base / "a.world")
    for uri in (
        "file://wall.dae",
        "model://elements/Media/models/wall.dae",
        "package://elements/media/models/wall.dae",
    ):
        assert resources.find(uri, base, "") == here
    assert resources.find("file://b.dae", base, "") == named
    with pytest.raises(InputError, match=r"secret\.dae"):
        resources.find(f"../../other/{secret.name}", base, "")


def test_an_online_model_is_found_as_gazebo_keeps_it(tmp_path, monkeypatch):
    monkeypatch.setenv("GZ_FUEL_CACHE_PATH", str(tmp_path / "fuel"))
    kept = tmp_path / "fuel" / "fuel.gazebosim.org" / "openrobotics" / "models" / "tunnel tile 1"
    old, new = put(kept / "2" / "model.sdf"), put(kept / "10" / "model.sdf")
    path = put(kept / "10" / "meshes" / "a.dae")
    resources, address = (
        Resources(tmp_path / "w.sdf"),
        "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Tunnel Tile 1",
    )
    assert old != new == model_file(resources, resources.find(address, tmp_path, ""))
    assert resources.find(f"{address}/10/files/meshes/a.dae", tmp_path, "") == path
    assert resources.find(f"{address}/tip/files/meshes/a.dae".replace(" ", "%20"), tmp_path, "") == path


@pytest.mark.parametrize(
    ("files", "chosen"),
    [
        ({"model.sdf": ""}, "model.sdf"),
        ({"tree.sdf": ""}, "tree.sdf"),
        ({"model.config": "<model><sdf version='1.6'>a.sdf</sdf></model>", "a.sdf": "", "model.sdf": ""}, "a.sdf"),
        ({"model.config": "<model><sdf version='1.6'>gone.sdf</sdf></model>", "model.sdf": ""}, "model.sdf"),
        ({"model.config": "broken", "model.sdf": ""}, "model.sdf"),
        ({"manifest.xml": "<gazebo><model><sdf version='1.4'>a.sdf</sdf></model></gazebo>", "a.sdf": ""}, "a.sdf"),
        (
            {
                "model.config": "<model><sdf version='1.5'>a.sdf</sdf><sdf version='1.10'>b.sdf</sdf>"
                "<sdf version='9.9'>c.sdf</sdf></model>",
                **dict.fromkeys(("a.sdf", "b.sdf", "c.sdf"), ""),
            },
            "b.sdf",
        ),
        ({"inner/model.config": "<model><sdf version='1.5'>a.sdf</sdf></model>", "inner/a.sdf": ""}, "inner/a.sdf"),
        ({"1/model.sdf": "", "2/model.sdf": ""}, "2/model.sdf"),
        ({"a/model.sdf": "", "b/model.sdf": ""}, None),
        ({"a.sdf": "", "b.sdf": ""}, None),
    ],
)
def test_the_file_of_a_model_is_found_in_its_folder(tmp_path, files, chosen):
    for name, content in files.items():
        put(tmp_path / "m" / name, content)
    resources = Resources(tmp_path / "w.sdf")
    if chosen is None:
        with pytest.raises(InputError, match=r"model\.sdf"):
            model_file(resources, tmp_path / "m")
    else:
        assert model_file(resources, tmp_path / "m") == tmp_path / "m" / chosen


def test_an_include_has_a_name_and_a_pose_of_its_own(tmp_path):
    put(tmp_path / "m" / "model.sdf", f"<sdf>{model('inside', box(1, 1, 1), pose='0 0 9 0 0 0')}</sdf>")
    text = "<include><static>true</static><uri>model://m</uri>{}</include>"
    world = write(tmp_path, text.format("<name>a</name><pose>1 2 3 0 0 0</pose>"), text.format(""))
    named, own = SdfWorld(world).models()
    assert (named.name, own.name) == ("a", "inside")
    assert (named.T_world[:3, 3].tolist(), own.T_world[:3, 3].tolist()) == ([1, 2, 3], [0, 0, 9])


def test_a_file_with_much_in_it_is_read_as_gazebo_does_and_says_so(tmp_path):
    two = f"<sdf><model name='a'><link name='l'>{box(1, 1, 1)}</link></model><model name='b'/></sdf>"
    put(tmp_path / "two" / "model.sdf", two)
    put(tmp_path / "lamp" / "model.sdf", "<sdf><light name='l' type='point'/></sdf>")
    put(tmp_path / "world" / "model.sdf", "<sdf><world name='w'/></sdf>")
    path = tmp_path / "a.sdf"
    path.write_text(two)
    assert [m.name for m in SdfWorld(path).models()] == ["a", "b"] and not said(path)
    world = write(tmp_path, include("model://two"), include("model://lamp"), include("model://world"))
    assert [m.name for m in SdfWorld(world).models()] == ["a", "world"]
    assert ["two/model.sdf" in said(world)[0], "world/model.sdf" in said(world)[1]] == [True, True]
    worlds = f"<sdf><world name='w'>{include('model://two')}</world><world name='v'/><model name='c'/></sdf>"
    path.write_text(worlds)
    assert [m.name for m in SdfWorld(path).models()] == ["a"]
    assert "'v'" in said(path)[0] or "v, <model> c" in said(path)[0]


def test_a_missing_mesh_or_model_is_named(tmp_path, caplog):
    shape = "<collision name='c'><geometry><mesh><uri>model://a/b.dae</uri></mesh></geometry></collision>"
    for parts, names in (
        ([model("m", shape)], "model://a/b.dae "),
        ([include("model://pump")], "model://pump "),
        ([include(f"model://{name}") for name in "abab"], "2 items: model://a, model://b "),
    ):
        caplog.clear()
        build_sdf(write(tmp_path, *parts))
        (line,) = caplog.messages
        assert names in line and "GAZEBO_MODEL_PATH" in line
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
    monkeypatch.setattr("sarsim.arenas.sdf.world.MAX_GEOMS", 100)
    for level in range(20):
        (tmp_path / f"m{level}").mkdir()
        inside = 2 * include(f"model://m{level + 1}") if level < 19 else ""
        (tmp_path / f"m{level}" / "model.sdf").write_text(f"<sdf><model name='m'>{inside}</model></sdf>")
    with pytest.raises(InputError, match=r"more models than the limit of 100"):
        build_sdf(write(tmp_path, include("model://m0")))


def test_deep_nesting_is_refused(tmp_path):
    path = tmp_path / "a.sdf"
    path.write_text("<sdf>" + "<model name='m'>" * 3000 + "</model>" * 3000 + "</sdf>")
    refused(path, "nested too deeply|cannot be parsed as XML: ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<sdf><world>", "cannot be parsed as XML: "),
        (
            "<sdf version='1.2'><model><link><origin pose='0 0 0 0 0 0'/></link></model></sdf>",
            "versions before 1.3, .* not supported",
        ),
        ("<mujoco/>", "must be <sdf>, not <mujoco>"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><sdf>&b;</sdf>", "declares a document type or entities"),
        (f"<sdf>{model('m', box('nan', 1, 1))}</sdf>", "<collision> c, <size>: must be 3 numbers .*, not 'nan 1 1'"),
        (
            f"<sdf>{model('m', box(1, 1, 1), pose='0 0 nan 0 0 0')}</sdf>",
            "<pose>: must be 6 numbers .*, not '0 0 nan 0 0 0'",
        ),
        (f"<sdf>{model('m', box(1, -1, 1))}</sdf>", "<collision> c: .* <box> must be non-negative, not -1"),
    ],
)
def test_broken_files_are_one_line(tmp_path, text, said):
    path = tmp_path / "a.sdf"
    path.write_text(text)
    refused(path, said)
