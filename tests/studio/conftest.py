from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import driven
import pytest
from clips import moving_scene, write_ffv1
from served import BASE, PORT, TOKEN
from starlette.testclient import TestClient

from itmo_video import analyse
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document
from itmo_video.studio.server import make_app


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """The page of a studio on a sample clip, which saves to `tmp_path`."""
    with driven.studio(driven.CLIP, tmp_path) as found:
        yield found


@pytest.fixture
def desk(clip: Path, tmp_path: Path) -> Iterator[Desk]:
    with Desk(clip, Document("default"), tmp_path) as opened:
        yield opened


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return TestClient(make_app(desk, TOKEN, PORT), base_url=f"{BASE}/{TOKEN}/")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("studio") / "scene.mkv"
    return write_ffv1(path, moving_scene(14, width=96, height=64, cuts=(8,)))


@pytest.fixture(scope="module")
def document(clip: Path) -> Document:
    return Document("default", {}, analyse(clip))
