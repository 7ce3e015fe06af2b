"""The command that draws the pictures of the documents."""

from importlib import import_module

import pytest

from pipeline.errors import InputError
from scripts import draw_pictures
from scripts.draw_pictures import CODE_PICTURES, FOLDER_PICTURES


@pytest.mark.parametrize("name", [*FOLDER_PICTURES, *CODE_PICTURES])
def test_every_picture_has_a_module_that_draws_it(name):
    assert callable(import_module(f"scripts.pictures.{name}").draw)


def test_an_unknown_picture_is_refused():
    with pytest.raises(InputError, match=r"portrait: no such picture; use .*semantic_map"):
        draw_pictures.draw_pictures(("portrait",))


def test_without_a_run_nothing_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(draw_pictures, "ROOT", tmp_path)
    with pytest.raises(InputError, match="make results PAGE=episode"):
        draw_pictures.draw_pictures()
