"""`Case.explore`: the page in a cell of a notebook, and the case that it shows."""

import json
import urllib.request
from html import escape

import nanotap
import pytest


def answered(page, path, body=None):
    address, token = page.url.split("/?token=")
    headers = {"x-nanotap-token": token, "content-type": "application/json"}
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address + path, data, headers)
    return urllib.request.urlopen(request, timeout=60)


def test_the_case_of_the_page_is_read_back():
    case = nanotap.Case.paper(omega=3)
    with case.explore() as page:
        assert page.case == case
        # As the page does when a slider moves.
        changed = {"preset": "file", "set": ["omega=3.1"]}
        with answered(page, "/api/motion", {"case": changed}) as answer:
            assert json.load(answer)["summary"].startswith("period 1")
        assert page.case == case.with_(omega=3.1)
    assert page._server.returncode is not None
    with pytest.raises(RuntimeError, match="closed"):
        str(page.case)
    assert "closed" in repr(page) + page._repr_html_()


def test_a_cell_of_a_notebook_on_this_machine_shows_the_page(physical):
    with physical.explore() as page:
        assert page.url in repr(page)
        assert f'<iframe src="{escape(page.url)}"' in page._repr_html_()
        with urllib.request.urlopen(page.url, timeout=60) as answer:
            policy = answer.headers["content-security-policy"]
        assert "frame-ancestors http://localhost:* http://127.0.0.1:*" in policy
        assert page.case.inputs == physical.inputs
        changed = {"preset": "file", "set": ["gap.tip=17 nm"]}
        answered(page, "/api/motion", {"case": changed}).close()
        assert page.case.inputs == physical.inputs | {"gap": {"tip": "17 nm"}}


def test_a_server_that_does_not_start_says_why(monkeypatch):
    case = nanotap.Case.paper()
    monkeypatch.setattr(nanotap.Case, "to_toml", lambda _: "omga = 2")
    with pytest.raises(RuntimeError, match="omga"):
        case.explore()
