"""The ``<state>`` of a saved world, and models that Gazebo's editor flattened."""

import numpy as np
import pytest

from tests.sarsim.arenas.sdf.worlds import PLANE, Compiled, box, model, write

MM = 1e-3
DOWN = (0, 0, -1)


def state(*content):
    return f"<state world_name='w'>{''.join(content)}</state>"


def moved(name, pose, *inside, tag="model"):
    return f"<{tag} name='{name}'><pose frame=''>{pose}</pose>{''.join(inside)}</{tag}>"


def top_at(arena, x):
    return 5 - arena.ray(x, 0, 5, along=DOWN)


def test_the_first_state_has_the_poses_of_models_and_links_in_the_world(tmp_path):
    inner = model("inner", box(0.2, 0.2, 0.2))
    two = "<link name='a'>" + box(0.4, 0.4, 0.4) + "</link><link name='b'>" + box(0.4, 0.4, 0.4) + "</link>"
    first = state(
        moved("m", "9 9 9 0 0 0", moved("a", "1 0 1 0 0 0", tag="link"), moved("b", "2 0 2 0 0 0", tag="link")),
        moved("outer", "9 9 9 0 0 0", moved("inner", "3 0 1 0 0 0", moved("l0", "3 0 1 0 0 0", tag="link"))),
    )
    again = state(moved("m", "0 0 0 0 0 0"))
    arena = Compiled(
        write(tmp_path, PLANE, f"<model name='m'>{two}</model>", model("outer", inside=inner), first, again)
    )
    np.testing.assert_allclose([top_at(arena, x) for x in (1, 2, 3)], [1.2, 2.2, 1.1], atol=MM)


def test_old_states_name_the_links_of_models_in_models_in_one(tmp_path):
    outer = model("outer", inside=model("inner", box(0.2, 0.2, 0.2), pose="0 0 1 0 0 0"))
    saved = state(moved("outer", "0 0 0 0 0 0", moved("inner::l0", "3 0 2 0 0 0", tag="link")))
    assert top_at(Compiled(write(tmp_path, PLANE, outer, saved)), 3) == pytest.approx(2.1, abs=MM)


def test_a_state_inserts_and_deletes_models(tmp_path):
    inserted = model("new", box(0.4, 0.4, 0.4), pose="2 0 1 0 0 0")
    saved = state(f"<insertions>{inserted}</insertions><deletions><name>old</name></deletions>")
    arena = Compiled(write(tmp_path, PLANE, model("old", box(0.4, 0.4, 0.4), pose="1 0 1 0 0 0"), saved))
    np.testing.assert_allclose([top_at(arena, x) for x in (1, 2)], [0, 1.2], atol=MM)


def test_links_of_a_flattened_model_are_as_the_editor_named_them(tmp_path):
    def link(name, pose):
        return f"<link name='{name}'><pose frame=''>{pose}</pose>{box(0.4, 0.4, 0.4)}</link>"

    joint = "<joint name='j'><pose>0 0 1 0 0 0</pose><parent>unit_box::link</parent>"
    joint += "<child>unit_box_0::link</child></joint>"
    frame = "<frame name='f' attached_to='j'><pose>1 0 0 0 0 0</pose></frame>"
    tip = f"<link name='tip::link'><pose relative_to='f'>0 0 0 0 0 0</pose>{box(0.2, 0.2, 0.2)}</link>"
    links = link("unit_box::link", "1 0 0 0 0 0") + link("unit_box_0::link", "2 0 0 0 0 0")
    flat = f"<model name='m'><pose>0 0 1 0 0 0</pose>{links}{joint}{frame}{tip}</model>"
    saved = state(moved("m", "0 0 1 0 0 0", moved("unit_box::link", "-1 0 2 0 0 0", tag="link")))
    for content, x, top in ((flat, 1, 1.2), (flat + saved, -1, 2.2)):
        arena = Compiled(write(tmp_path, PLANE, content))
        assert top_at(arena, x) == pytest.approx(top, abs=MM)
        assert top_at(arena, 3) == pytest.approx(2.1, abs=MM)  # above the second box and beside it


def test_a_frame_that_is_none_did_no_harm_before_sdf_1_7(tmp_path):
    pose = "<pose frame='map'>1 0 1 0 0 0</pose>"
    part = f"<model name='m'>{pose}<link name='l'>{pose}{box(0.4, 0.4, 0.4)}</link></model>"
    assert top_at(Compiled(write(tmp_path, PLANE, part, version="1.5")), 2) == pytest.approx(2.2, abs=MM)
