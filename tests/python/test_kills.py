"""Some of the kills of kills.py, which makes 200 of them in `make slow`."""

import random

import pytest
from kills import STUDIES, kill_often


@pytest.mark.parametrize("title", STUDIES)
def test_a_killed_run_goes_on_to_the_same_bits(title, tmp_path):
    kills, left_checkpoints, _ = kill_often(*STUDIES[title], 6, random.Random(title), tmp_path)
    assert kills >= 6 and left_checkpoints > 0
