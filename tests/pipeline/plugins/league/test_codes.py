"""The file of the codes that a run has read."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.league.codes import codes_among, read_codes, write_codes
from pipeline.plugins.league.hand_in import league_frame
from tests.pipeline.plugins.league.handed_in_room import FINDS, found


def test_what_is_written_is_read(tmp_path):
    finds = [
        *FINDS,
        found("qr_code", 'a,"b"', [9.0, 0.0, 0.5], 7.0, 0.5),
        found("qr_code", "ü\n", [1.0, 0, 0], 1.0, 1.0),
    ]
    path = tmp_path / "codes.json"
    write_codes(path, codes_among(finds, league_frame(np.eye(4), 0.25)))
    codes = read_codes(path)
    assert [code.text for code in codes] == ['a,"b"', "ü\n"]
    # The frame looks along y from 0.25 m before the middle; of two readings the surer counts.
    assert codes[0].position == pytest.approx([-1.9, -0.25, 0.5]) and codes[0].is_autonomous


@pytest.mark.parametrize(
    "text",
    [
        "", "{}", "[1]", '[{"text": "A"}]', '[{"text": "A", "position": [1, 2]}]', "[" * 9999,
        '[{"text": 1, "position": [1, 2, 3]}]', '[{"text": "A", "position": [1, 2, NaN]}]',
        '[{"text": "A", "position": [1, 2, 1%s]}]' % ("0" * 400),
    ],
)  # fmt: skip
def test_other_files_are_refused_in_one_line(tmp_path, text):
    path = tmp_path / "codes.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"codes\.json") as error:
        read_codes(path)
    assert "\n" not in str(error.value)
