"""The way into the page: no token in an argument of a browser, and no folder that is closed unasked."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from mortal import mortal
from serving import HERE, TOKEN, _path, client, client_of, desk, until

from cosim_serve.desk import Desk
from cosim_serve.door import NAME, door

__all__ = ["_path", "client", "desk"]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes and /proc")


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_browser_is_opened_with_a_file_that_its_owner_alone_can_read_and_that_leads_to_the_address(
    tmp_path: Path,
) -> None:
    told, home = tmp_path / "told", tmp_path / "data"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {told}.new && mv {told}.new {told}\n', "utf-8")
    browser.chmod(0o755)
    command = mortal(sys.executable, "-m", "cosim", "serve", "--data", str(home))
    environment = os.environ | {"BROWSER": f"{browser} %s"}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=HERE.parent, env=environment
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        until(told.exists)
        given = told.read_text("utf-8").strip()
        assert given == (home / NAME).as_uri()
        token = address.partition("token=")[2]
        assert len(token) > 30
        assert token not in given
        assert mode(home / NAME) == 0o600
        assert f"url={address}" in (home / NAME).read_text("utf-8")
    finally:
        process.terminate()
        process.communicate(timeout=60)
    assert not (home / NAME).exists()


def test_what_lies_at_the_place_of_that_file_is_not_followed(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("kept", "utf-8")
    (tmp_path / NAME).symlink_to(other)
    with door(tmp_path, "http://127.0.0.1:1/?token=x") as path:
        assert path is not None
        assert not path.is_symlink()
    assert other.read_text("utf-8") == "kept"
    with door(tmp_path / "nowhere", "http://127.0.0.1:1/?token=x") as path:
        assert path is None


def test_who_comes_from_a_file_is_led_on_by_a_page_as_the_cookie_is_not_given_to_a_redirect(desk: Desk) -> None:
    stranger = client_of(desk, token="wrong")
    answer = stranger.get(f"/?token={TOKEN}", headers={"sec-fetch-site": "cross-site"}, follow_redirects=False)
    assert answer.status_code == 200
    assert 'content="0; url=/"' in answer.text
    assert TOKEN not in answer.text
    assert stranger.get("/").status_code == 200


@pytest.mark.parametrize(("before", "who"), [(0o775, "everybody"), (0o750, "its group"), (0o700, "")])
def test_a_folder_that_is_there_keeps_its_mode_and_that_is_said(tmp_path: Path, before: int, who: str) -> None:
    home = tmp_path / "project"
    home.mkdir()
    home.chmod(before)
    command = mortal(sys.executable, "-m", "cosim", "serve", "--no-browser", "--data", str(home))
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=HERE.parent)
    assert process.stdout is not None
    try:
        process.stdout.readline()
        assert mode(home) == before
    finally:
        process.terminate()
        said = process.communicate(timeout=60)[1]
    assert mode(home) == before
    assert (f"{home} can be entered by {who}" in said) == bool(who)


def test_what_the_page_makes_is_closed_to_others(tmp_path: Path, desk: Desk) -> None:
    job = desk.store.new()
    folder = desk.store.folder(job.id)
    assert [mode(one) for one in (desk.store.home, folder, folder / "recordings", folder / "views")] == [0o700] * 4
    with desk.arriving(job.id, "a.csv", 10) as arrival:
        assert mode(arrival.path.parent) == 0o700
    made = Desk(tmp_path / "one" / "two", reader=desk.reader)
    assert mode(made.store.home) == 0o700
    made.queue.close()


def test_the_file_leads_to_the_address_also_by_hand(tmp_path: Path) -> None:
    with door(tmp_path, "http://127.0.0.1:1/?token=a&b") as path:
        assert path is not None
        assert re.search(r'href="http://127\.0\.0\.1:1/\?token=a&amp;b"', path.read_text("utf-8"))
