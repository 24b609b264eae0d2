"""Ports whose other end takes nothing."""

from __future__ import annotations

import os
import socket
import tty

import pytest

from cmg_mj.codegen.board import ports
from cmg_mj.codegen.board.ports import open_port


def test_a_connection_that_takes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody reads at the other end: that is no pulled cable."""
    monkeypatch.setattr(ports, "CONNECT_S", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = open_port(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        with pytest.raises(ports.Closed, match=r"^the connection has taken no byte for 5 s: flow control, or a conv"):
            port.write(bytes(1 << 24))
        port.close()


def test_a_serial_line_that_takes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("serial")
    monkeypatch.setattr(ports, "CONNECT_S", 0.05)
    master, slave = os.openpty()
    tty.setraw(slave)
    port = open_port(os.ttyname(slave))
    with pytest.raises(ports.Closed, match=r"^the line has taken no byte for 5 s: flow control, or a converter"):
        port.write(bytes(1 << 20))
    port.close()
    os.close(master)
    os.close(slave)
