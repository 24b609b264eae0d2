"""Ports: names that are none, what cannot be opened, and other ends that leave or take nothing."""

from __future__ import annotations

import os
import socket
import threading
import tty

import pytest

from cmg_mj.codegen.board import ports
from cmg_mj.codegen.board.ports import open_port
from cmg_mj.errors import InputError


@pytest.mark.parametrize("name", ["tcp:", "tcp:5555", "tcp:here:", "tcp:here:x", "tcp:here:0", "tcp:here:65536"])
def test_a_tcp_port_that_is_none(name: str) -> None:
    with pytest.raises(InputError, match=r"^--port '?tcp:.*: write tcp:HOST:PORT, such as tcp:localhost:5555$"):
        open_port(name)


def test_ports_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        free = server.getsockname()[1]
    with pytest.raises(InputError, match=rf"^--port tcp:127\.0\.0\.1:{free}: cannot be reached: Connection refused$"):
        open_port(f"tcp:127.0.0.1:{free}")
    with pytest.raises(InputError, match=r"^--baud 9600: tcp:here:1 has no baud rate; leave it out$"):
        open_port("tcp:here:1", 9600)
    monkeypatch.setattr(ports, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r'^--port COM3: pyserial is not installed: python -m pip install "cmg_mj\[board\]"$'
    ):
        open_port("COM3")


def test_a_serial_port_that_is_none() -> None:
    pytest.importorskip("serial")
    with pytest.raises(InputError, match=r"^--port /dev/none: cannot be opened at 460800 baud: .*No such file"):
        open_port("/dev/none")


def test_a_connection_that_ends() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = open_port(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        other, _ = server.accept()
        answering = threading.Thread(target=lambda: (other.sendall(other.recv(5)[::-1]), other.close()))
        answering.start()
        port.write(b"hello")
        assert port.read(5.0) == b"olleh"
        answering.join()
        with pytest.raises(ports.Closed, match="the connection is closed"):
            port.read(5.0)
        port.close()


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
