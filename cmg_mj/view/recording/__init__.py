"""Writes runs and logs as rerun recordings, and streams runs to rerun's viewer; no other package imports rerun."""

from cmg_mj.view.recording.run import RecordingHeader, Run
from cmg_mj.view.recording.save import write_recording

__all__ = ["RecordingHeader", "Run", "write_recording"]
