"""The command: what it refuses, in one line; the web view on loopback alone; and both threads for real."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mujoco.studio import endpoints, messages, viewer_protocol

from cmg_mj.features.studio import open as opening
from cmg_mj.features.studio.panel import SessionState
from tests.command import COMMAND, HANGS_AFTER_S, cmg_mj, cmg_mj_process


def test_graphics_that_cannot_be_had_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a screen a window would end the process; Python 3.11 has no windows at all."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    complaint = cmg_mj("studio", "push_recovery", "--viewer", "native").complaint
    assert complaint.startswith("--viewer native: MuJoCo Studio")
    assert complaint.endswith("; take --viewer web")


def free_port() -> int:
    """Not one that another test, in another process, might look for at the same time."""
    with socket.socket() as result:
        result.bind(("127.0.0.1", 0))
        return result.getsockname()[1]


class Looker:
    """Stands for the web viewer: it sees the simulation go on, and closes."""

    def __init__(self, config: viewer_protocol.ViewerConfig, endpoint: endpoints.ViewerEndpoint, **_: object) -> None:
        self.config, self.endpoint, self.ticks = config, endpoint, 0

    def look(self) -> None:
        for _ in range(10_000):  # a simulation that stands still is not waited for without end
            time.sleep(0.01)
            states = [state for state in self.endpoint.get_sim_snapshots() if isinstance(state, SessionState)]
            self.ticks = max([self.ticks, *(len(state.ticks) for state in states)])
            if self.ticks >= 10:
                break
        self.endpoint.send_to_sim(messages.ExitEvent())


def test_the_command_opens_a_scenario_until_its_viewer_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """All but the browser's view, which the slow tests open."""
    opened: list[Looker] = []
    monkeypatch.setattr(opening, "LoopbackViewer", Looker)
    monkeypatch.setattr(viewer_protocol, "run_viewer_loop", lambda looker: (opened.append(looker), looker.look()))
    outcome = cmg_mj("studio", "push_recovery", "--observer", "ltv", "--port", "8123")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    (looker,) = opened
    assert (looker.config.title, looker.config.gfx, looker.config.http_port) == ("Push recovery", "web", 8123)
    assert looker.ticks >= 10


@pytest.mark.slow
def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    """In a process of its own: Studio hooks into Python's log, warnings and exceptions for as long as one lasts."""
    with socket.socket() as other_socket:
        other_socket.bind(("127.0.0.1", 0))
        other_socket.listen()
        port = other_socket.getsockname()[1]
        outcome = cmg_mj_process("studio", "push_recovery", "--port", port, cwd=tmp_path)
    assert f"Port {port} is already in use" in outcome.complaint


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_command_listens_on_loopback_alone_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*COMMAND, "studio", "push_recovery", "--port", str(free_port())],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"HOME": str(tmp_path)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        output = []
        assert process.stdout is not None
        for line in process.stdout:
            output.append(line)
            if "Model changed" in line:
                break
        assert any("http://localhost:" in line for line in output)
        assert set(listening_addresses(process.pid)) == {"127.0.0.1"}
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=HANGS_AFTER_S)
        assert process.returncode == 0
        assert "Traceback" not in rest
    finally:
        process.kill()


def listening_addresses(pid: int) -> list[str]:
    """The addresses at which a process listens."""
    sockets = {os.readlink(entry) for entry in Path(f"/proc/{pid}/fd").iterdir() if entry.is_symlink()}
    addresses = []
    for table in ("tcp", "tcp6"):
        path = Path(f"/proc/{pid}/net/{table}")
        for line in path.read_text().splitlines()[1:] if path.exists() else []:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                address = bytes.fromhex(fields[1].split(":")[0])
                addresses.append(socket.inet_ntop(socket.AF_INET, address[::-1]) if table == "tcp" else address.hex())
    return addresses
