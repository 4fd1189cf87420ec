"""A Dask scheduler's address and certificates, validated before anything is done."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from typing import TYPE_CHECKING

from itmo_video.errors import UsageError

if TYPE_CHECKING:
    from distributed.security import Security

LOCAL = "local"
_SUCH_AS = "Such as tcp://host:8786."


@dataclass(frozen=True)
class Tls:
    """PEM files as `dask scheduler` and `dask worker` take them; None: as Dask is configured.

    `key` may be in the file of `cert`.
    """

    ca_file: str | None = None
    cert: str | None = None
    key: str | None = None


def check_address(address: str) -> None:
    """Raise UsageError unless this is a scheduler's address, with a host that is known.

    Whether a scheduler answers there is not checked: it may still be starting.
    """
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    if address == LOCAL:
        return
    try:
        scheme, place = parse_address(address)
        get_backend(scheme)
        if scheme == "inproc":  # of this process: host/process/number
            if place.count("/") != 2:
                raise ValueError(f"no scheduler of this process is called {place!r}")
            return
        host, port = parse_host_port(place)
        if not (host and 0 < int(port) < 65536):
            raise ValueError(f"no host or no port in {place!r}")
    except (ValueError, TypeError) as error:
        raise UsageError(
            f"not a scheduler's address: {error}", where=address, remedy=_SUCH_AS
        ) from error
    try:
        socket.getaddrinfo(host, int(port))
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UsageError(
            f"no such host, {host!r}: {reason}", where=address, remedy=_SUCH_AS
        ) from error


def security_for(address: str, tls: Tls) -> Security | None:
    """The client's security settings; None if nothing is encrypted.

    Raises UsageError for files that cannot be read, and for tls:// without any.
    """
    from distributed.security import Security

    given = {
        name: value
        for name, value in (
            ("tls_ca_file", tls.ca_file),
            ("tls_client_cert", tls.cert),
            ("tls_client_key", tls.key),
        )
        if value is not None
    }
    is_encrypted = address.startswith(("tls://", "wss://"))
    if given and not is_encrypted:
        raise UsageError(
            "certificates need an encrypted scheduler, tls://",
            where=address,
            remedy="tls://host:8786",
        )
    if not is_encrypted:
        return None
    security = Security(require_encryption=True, **given)  # the rest as Dask is configured
    try:
        context = security.get_connection_args("client").get("ssl_context")
    except (OSError, ValueError, TypeError) as error:  # of SSL, too
        raise UsageError(f"the certificates cannot be used: {error}", where=address) from error
    if context is None:
        raise UsageError(
            "an encrypted scheduler needs certificates",
            where=address,
            remedy="--tls-ca-file, --tls-cert and --tls-key, or Dask's configuration.",
        )
    return security
