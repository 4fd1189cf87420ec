"""What strangers get of the studio: nothing."""

from __future__ import annotations

from served import BASE, JSON, PORT, TOKEN
from starlette.testclient import TestClient

from itmo_video.studio.desk import Desk
from itmo_video.studio.server import make_app


def test_strangers_are_refused(desk: Desk) -> None:
    client = TestClient(make_app(desk, TOKEN, PORT), base_url=BASE)
    good = f"/{TOKEN}/api/state"
    assert client.get(good).status_code == 200
    for path in ("/", "/api/state", "/wrong/api/state", f"/{TOKEN}", "/s3cre/api/state", "//"):
        assert client.get(path).status_code == 403, path
    for host in ("evil.example", "evil.example:4711", "127.0.0.1", "127.0.0.1:80", ""):
        assert client.get(good, headers={"host": host}).status_code == 421, host
    assert client.get(good, headers={"host": f"localhost:{PORT}"}).status_code == 200
    for origin in ("http://evil.example", "null", "https://127.0.0.1:4711", "http://127.0.0.1"):
        assert client.get(good, headers={"origin": origin}).status_code == 403, origin
    told = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    opening = {**told, "sec-fetch-dest": "document"}
    assert client.get(f"/{TOKEN}/", headers=opening).status_code == 200, "a link to the page"
    for path, headers in ((good, opening), (f"/{TOKEN}/main.js", opening), (f"/{TOKEN}/", told),
                          ("/wrong/", opening)):  # fmt: skip
        assert client.get(path, headers=headers).status_code == 403, path
    assert client.get(good, headers={"origin": BASE}).status_code == 200
    for site in ("cross-site", "same-site"):
        assert client.get(good, headers={"sec-fetch-site": site}).status_code == 403, site
    edit = f"/{TOKEN}/api/edit"
    assert client.post(edit, content="do=undo").status_code == 415
    assert client.post(edit, content=b"x" * 70000, headers=JSON).status_code == 413


def test_no_path_leads_out(desk: Desk) -> None:
    client = TestClient(make_app(desk, TOKEN, PORT), base_url=BASE)
    for path in ("../server.py", "%2e%2e/server.py", "viewer/../../cli/main.py", "..%2f..%2fx",
                 "/etc/passwd", "page/index.html", "viewer/", "api/picture/..", ".."):  # fmt: skip
        assert client.get(f"/{TOKEN}/{path}").status_code in (403, 404), path


def test_headers_forbid_all_else(client: TestClient) -> None:
    answer = client.get("")
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert answer.headers["cache-control"] == "no-store"
