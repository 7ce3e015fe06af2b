"""Heights and labels under vertical rays against the format's description, and files that are no good."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.errors import InputError
from sarsim.arenas.elements import element_library
from sarsim.arenas.load import load_arena
from sarsim.arenas.raf import TYPE_PREFIXES, TYPES, build_raf
from sarsim.sensors.camera import geom_labels
from sarsim.victims.victims import victims_of
from tests.sarsim.arenas.raf_geometry import CLUTTER, ELEMENTS, LOOSE, MOUNTS, TILE, WALL, steady, top_of

HIGH = 10.0
LOOSE_TYPES = ("stepfield_red_diagonal", "spectator_120", "fire_extinguisher")


def write(path, *elements):
    path = path / "arena.raf"
    path.write_text("<elements>" + "".join(f"<element {e}/>" for e in elements) + "</elements>")
    return path


def compile_raf(path):
    builder = build_raf(path)
    model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def look_down(model, data, x, y):
    """Heights and labels that vertical rays from above meet."""
    labels, geom = geom_labels(model), np.zeros(1, np.int32)
    height, label = [], []
    for point in zip(x, y, strict=True):
        distance = mujoco.mj_ray(
            model, data, np.array([*point, HIGH]), np.array([0, 0, -1.0]), None, 1, -1, geom, None
        )
        height.append(HIGH - distance)
        label.append(labels[geom[0]] if geom[0] >= 0 else 0)
    return np.array(height), np.array(label)


def compare(path, elements, x, y):
    known = steady(elements, x, y)
    height, label = look_down(*compile_raf(path), x[known], y[known])
    expected_height, expected_label = top_of(elements, x[known], y[known])
    assert_allclose(height, expected_height, atol=0.002)
    assert_array_equal(label, expected_label)
    return known.mean()


def test_every_type_of_the_format_is_known():
    assert element_library().types >= TYPES | set(TYPE_PREFIXES.values())
    assert {k for k in (*ELEMENTS, *LOOSE_TYPES) if not k.startswith(tuple(TYPE_PREFIXES))} == TYPES


@pytest.mark.parametrize("kind", sorted(ELEMENTS))
def test_an_element_has_the_shape_and_label_of_its_type(kind, tmp_path):
    tile_x, tile_y, rotation, shift_x, shift_y = 3, -2, 90, 0.25, -0.5
    path = write(
        tmp_path,
        f'type="{kind}" x="{tile_x}" y="{tile_y}" rotation="{rotation}" offset-x="{shift_x}" offset-y="{shift_y}"',
    )
    centre = np.array([tile_x + shift_x, tile_y + shift_y]) * TILE
    steps = np.linspace(-0.683, 0.683, 41)
    u, v = (g.ravel() for g in np.meshgrid(steps, steps))
    # A panel is 1 cm thick: points along its middle are needed too.
    along = np.linspace(-0.571, 0.567, 31)
    u = np.concatenate([u, along, along, along, np.zeros(5)])
    v = np.concatenate([v, np.full(31, 0.6), along, np.abs(along), np.linspace(-0.01, 0.01, 5)])
    # Rotated by 90° clockwise, the element's +y points along the world's +x.
    elements = [(kind, *centre, rotation, (0.0, 0.0))]
    assert compare(path, elements, centre[0] + v, centre[1] - u) > 0.5
    assert (top_of(elements, centre[0] + v, centre[1] - u)[0] > 0).sum() > 5


@pytest.mark.parametrize("rotation", [0, 30, 180, 270, -90])
def test_rotations_are_clockwise(rotation, tmp_path):
    path = write(tmp_path, f'type="half_ramp" x="0" y="0" rotation="{rotation}"')
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.8, 0.8, (2, 400))
    assert compare(path, [("half_ramp", 0, 0, rotation, (0, 0))], x, y) > 0.8


def assert_victim_in_box(model, data, middle):
    """Five boards of clutter are about a place (3,), m, within them is one victim, and nothing else has its label."""
    boards = [geom for geom in range(model.ngeom) if model.geom(geom).name.startswith("victim_with_box")]
    places = data.geom_xpos[boards]
    assert len(boards) == 5 and (geom_labels(model)[boards] == CLUTTER).all()
    lowest, highest = places.min(axis=0), places.max(axis=0)
    assert_allclose((lowest + highest)[[0, 2]] / 2, np.array(middle)[[0, 2]], atol=0.002)
    (victim,) = victims_of(model, data)
    corners = victim.T_world_victim[:3, :3] @ victim.box.T + victim.T_world_victim[:3, 3:]
    assert (np.abs(corners - np.array(middle)[:, None]) < [[0.24], [0.12], [0.19]]).all()
    assert set(np.flatnonzero(geom_labels(model) == 6)) == set(victim.geoms)


@pytest.mark.parametrize("wall", sorted(MOUNTS))
@pytest.mark.parametrize("point", [0, 1, 2])
def test_what_hangs_on_a_wall_hangs_at_its_mount_point(wall, point, tmp_path):
    hung = f'type="victim_with_box1" x="1" y="2" rotation="180" mount-point="{point}"'
    path = write(tmp_path, hung, f'type="{wall}" x="1" y="2" rotation="180"')
    mx, my = MOUNTS[wall][point]
    # Turned round, the wall is at the tile's south side and the element's x runs along the world's -x.
    assert_victim_in_box(*compile_raf(path), (1.2 - (mx - 0.6), 2.4 - 0.47, my))


def test_without_a_number_it_hangs_at_the_first_mount_point_and_on_a_plain_wall_at_none(tmp_path):
    hung = 'type="victim_with_box1" x="0" y="0" rotation="0"'
    for wall, expected in (("wall_holes1", (-0.3, 0.47, 0.9)), ("small_wall", (0, 0.47, 0))):
        path = write(tmp_path, f'type="{wall}" x="0" y="0" rotation="0"', hung)
        assert_victim_in_box(*compile_raf(path), expected)
    elsewhere = write(tmp_path, 'type="wall_holes1" x="0" y="0" rotation="90"', hung)
    assert_victim_in_box(*compile_raf(elsewhere), (0, 0.47, 0))


def test_a_step_field_has_posts_of_5_to_40_cm_the_highest_along_the_diagonal(tmp_path):
    model, data = compile_raf(write(tmp_path, 'type="stepfield_red_diagonal" x="0" y="0" rotation="0"'))
    middles = (np.arange(11) - 5) * 1.18 / 11
    x, y = (g.ravel() for g in np.meshgrid(middles, middles))
    height, label = look_down(model, data, x, y)
    assert (label == 7).all()
    assert height.min() == pytest.approx(0.05) and height.max() == pytest.approx(0.4)
    assert_allclose(height[x == y], 0.4, atol=1e-6)


def test_holes_let_a_ray_through_and_the_panel_around_them_does_not(tmp_path):
    model, data = compile_raf(write(tmp_path, 'type="wall_holes1" x="0" y="0" rotation="0"'))
    labels, geom = geom_labels(model), np.zeros(1, np.int32)

    def hits_wall(x, z):
        ray = np.array([x, 0, z]), np.array([0, 1.0, 0])
        distance = mujoco.mj_ray(model, data, *ray, None, 1, -1, geom, None)
        return 0 <= distance < 1 and labels[geom[0]] == WALL

    for x, z in ((-0.29, 0.90), (0.29, 0.59), (-0.28, 0.31)):
        for angle in np.arange(12) * np.pi / 6:
            for radius, expected in ((0.0, False), (0.072, False), (0.079, True)):
                assert hits_wall(x + radius * np.cos(angle), z + radius * np.sin(angle)) == expected


def test_signs_and_props_are_clutter_of_up_to_40_cm(tmp_path):
    for kind in ("hazmat", "hazmat_poison", "start_check", "start_check_board", "spectator_120", "fire_extinguisher"):
        model, _ = compile_raf(write(tmp_path, f'type="{kind}" x="0" y="0" rotation="0"'))
        others = np.arange(model.ngeom) != model.geom("floor").id
        assert set(geom_labels(model)[others]) == {7}
        assert model.geom_aabb[others, 3:].max() <= 0.2 + 1e-6


def test_elements_on_the_same_place_count_once(tmp_path):
    once = compile_raf(write(tmp_path, 'type="small_wall" x="0" y="0" rotation="0"'))[0].ngeom
    # The wall north of a tile is the wall south of the next one.
    twice = ['type="small_wall" x="0" y="0" rotation="0"'] * 2 + ['type="small_wall" x="0" y="1" rotation="180"']
    assert compile_raf(write(tmp_path, *twice))[0].ngeom == once


@pytest.mark.parametrize(
    ("inner", "outer"),
    [
        ("wall_holes1", "small_wall"),
        ("small_wall_no_tex", "small_wall"),
        ("small_wall", "tall_wall"),
        ("veil_wall", "tall_wall"),
    ],
)
@pytest.mark.parametrize("rotation", [0, 33.3])
def test_a_panel_inside_another_is_left_out(inner, outer, rotation, tmp_path):
    """With both panels, rendering and ray casting would not agree on which of them they hit."""
    plain = f'type="{outer}" x="0" y="0" rotation="{rotation}"'
    both = [plain, f'type="{inner}" x="0" y="0" rotation="{rotation}"']
    alone, first, last = (compile_raf(write(tmp_path, *lines))[0] for lines in ([plain], both, both[::-1]))
    # The rims of round holes are no boxes, and are kept.
    rims = 3 * (inner == "wall_holes1")
    assert alone.ngeom + rims == first.ngeom == last.ngeom
    apart = write(tmp_path, plain, both[1].replace('x="0"', 'x="0" offset-y="0.01"'))
    assert compile_raf(apart)[0].ngeom > alone.ngeom + rims


def compare_as_written(path):
    """Compare 1,000 rays over a whole arena, except near elements whose shape is not given to the millimetre."""
    elements, bounds = read_plainly(path)
    x, y = np.random.default_rng(0).uniform(*bounds, (1000, 2)).T
    loose = [e for e in elements if e[0].startswith(LOOSE)]
    near_loose = np.zeros(1000, bool)
    for _, x0, y0, _, (along, _) in loose:
        near_loose |= np.hypot(x - x0, y - y0) < 0.9 + abs(along)
    rest = [e for e in elements if e not in loose]
    return compare(path, rest, x[~near_loose], y[~near_loose])


def test_arenas_that_were_used_are_as_their_files_say(shared, subtests):
    files = sorted((shared / "arenas" / "raf").glob("*.raf"))
    assert files
    for path in files:
        with subtests.test(path.stem):
            assert compare_as_written(path) > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_an_arena_of_all_types_in_disorder_is_as_its_file_says(seed, tmp_path):
    path = tmp_path / "made_up.raf"
    path.write_text(made_up(np.random.default_rng(seed)))
    assert compare_as_written(path) > 0.75


def made_up(rng):
    """A file with two of every type, at any angle, shifted, some hanging on walls with holes."""

    def place(tiles=9):
        x, y = rng.integers(-tiles, tiles, 2)
        rotation = rng.choice(["0", "90", "180", "270", "-90", "450", "37.5", f"{rng.uniform(-400, 400):.4f}"])
        return f'x="{x}" rotation="{rotation}" y="{y}"'

    lines = []
    for kind in 2 * [*ELEMENTS, *LOOSE_TYPES]:
        shift = f'offset-y="{rng.uniform(-1, 1):.3f}" offset-x="{rng.integers(-2, 3) / 4}"'
        lines.append(f'<element {place()} type="{kind}" {shift if rng.random() < 0.5 else ""}/>')
    for kind in 2 * ["victim_with_box1", "victim_doll_heat_with_box", "victim_1", "hazmat_acid", "start_check_a"]:
        where, point = place(), rng.integers(0, 3)
        lines.append(f'<element type="{rng.choice(sorted(MOUNTS))}" {where}/>')
        lines.append(f'<!-- on a wall -->\n  <element mount-point="{point}" {where} type="{kind}"></element>')
    rng.shuffle(lines)
    return '<?xml version="1.0"?>\n<elements>\n' + "\n\t".join(lines) + "\n</elements>\n"


def read_plainly(path):
    """The elements of known types with their mount points, and the corners around them."""
    lines = [e.attrib for e in ET.parse(path).getroot() if e.get("type").startswith((*ELEMENTS, *LOOSE))]
    tiles = [(float(e["x"]), float(e["y"]), float(e["rotation"]) % 360) for e in lines]
    walls = {tile: MOUNTS[e["type"]] for tile, e in zip(tiles, lines, strict=True) if e["type"] in MOUNTS}
    elements = []
    for tile, e in zip(tiles, lines, strict=True):
        x, y = (TILE * (float(e[k]) + float(e.get(f"offset-{k}", 0))) for k in "xy")
        hangs = e["type"].startswith(("victim_", "start_check", "hazmat"))
        mounts = walls.get(tile) if hangs else None
        mx, my = mounts[int(e.get("mount-point", 0))] if mounts else (0.6, 0.0)
        elements.append((e["type"], x, y, float(e["rotation"]), (mx - 0.6, my)))
    xy = np.array([e[1:3] for e in elements])
    return elements, (xy.min(axis=0) - 0.4, xy.max(axis=0) + 0.4)


SMALL_WALL = '<element type="small_wall" x="0" y="0" rotation="0"/>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<elements><element", "cannot be parsed as XML: "),
        (
            '<!DOCTYPE a [<!ENTITY b "c">]><elements><element type="&b;" x="0" y="0" rotation="0"/></elements>',
            "declares a document type or entities",
        ),
        (
            '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hosts">]><elements>&b;</elements>',
            "declares a document type or entities",
        ),
        ("<robot/>", "must be <elements>, not <robot>"),
        ("<elements/>", "contains no <element>"),
        (
            '<elements><element type="small_wall" x="0" rotation="0"/></elements>',
            "element 1: the attribute 'y' is missing",
        ),
        ('<elements><element x="0" y="0" rotation="0"/></elements>', "'type' is missing"),
        ('<elements><element type="small_wall" x="one" y="0" rotation="0"/></elements>', "x must be .*, not 'one'"),
        ('<elements><element type="small_wall" x="nan" y="0" rotation="0"/></elements>', "x must be .*, not 'nan'"),
        ('<elements><element type="small_wall" x="1e9" y="0" rotation="0"/></elements>', "x must be .*, not '1e9'"),
        (
            '<elements><element type="small_wall" x="0" y="0" rotation="inf"/></elements>',
            "rotation must be .*, not 'inf'",
        ),
        (
            '<elements><element type="small_wall" x="0" y="0" rotation="0" mount-point="-1"/></elements>',
            "mount-point must be .*, not '-1'",
        ),
        (
            '<elements><element type="victim_1" x="0" y="0" rotation="0" offset-x="5000"/></elements>',
            "x=5000 to x=5000",
        ),
        ('<elements><element type="a" x="0" y="0" rotation="0"/></elements>', "element 1: unknown type 'a'$"),
        (
            f'<elements>{SMALL_WALL}<element type="smal_wall" x="0" y="0" rotation="0"/></elements>',
            "2: .* meant small_wall$",
        ),
        (
            f'<elements>{SMALL_WALL}<element type="victim_2" x="0" y="0" rotation="0"/></elements>',
            "2: .* meant victim_1$",
        ),
        # An element of random arenas that is no type of the format.
        (
            f'<elements>{SMALL_WALL}<element type="ramp_17" x="0" y="0" rotation="0"/></elements>',
            "2: unknown type 'ramp_17'",
        ),
        (
            SMALL_WALL.join(("<elements>", "</elements>")).replace("/>", ' mountpoint="1"/>'),
            "'mountpoint'; .* mount-point$",
        ),
        (
            f'<elements>{SMALL_WALL}<elemnt type="small_wall" x="0" y="0" rotation="0"/></elements>',
            "only <element>, not <elemnt>",
        ),
        (
            "<elements>" + '<element type="small_wall" x="0" y="0" rotation="0"/>' * 5000 + "</elements>",
            "5000 elements; .* 1500",
        ),
    ],
    ids=lambda value: value[:24],
)
def test_a_bad_file_is_refused_in_one_line(text, message, tmp_path):
    path = tmp_path / "bad.raf"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        load_arena(str(path))
    assert "\n" not in str(error.value)
    assert "bad.raf" in str(error.value)


def test_a_bomb_of_entities_is_refused(tmp_path):
    entities = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10 if n else "boom"}">' for n in range(12))
    path = tmp_path / "bomb.raf"
    path.write_text(f"<!DOCTYPE a [{entities}]><elements><element type='&e11;' x='0' y='0' rotation='0'/></elements>")
    with pytest.raises(InputError):
        load_arena(str(path))


def test_missing_and_huge_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        load_arena(str(tmp_path / "none.raf"))
    huge = tmp_path / "huge.raf"
    huge.write_bytes(b" " * 3_000_000)
    with pytest.raises(InputError, match="3000000 bytes; the limit is 2000000 bytes"):
        load_arena(str(huge))


def test_an_arena_all_of_whose_tiles_are_taken_has_no_start(tmp_path):
    stepfields = [f'type="stepfield_red_diagonal" x="{i}" y="{j}" rotation="0"' for i in range(2) for j in range(2)]
    with pytest.raises(InputError, match=r"arena\.raf: .*start"):
        load_arena(str(write(tmp_path, *stepfields)))
