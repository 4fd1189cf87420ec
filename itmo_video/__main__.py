"""`python -m itmo_video` is `itmo-video`."""

from itmo_video.cli.main import run

run()
