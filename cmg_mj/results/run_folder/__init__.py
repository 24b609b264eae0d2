"""The folder that a run writes: claimed before it, and its result put there whole."""

from cmg_mj.results.run_folder.folder import RunFolder, Writers, claimed, unused_folder, write_text

__all__ = ["RunFolder", "Writers", "claimed", "unused_folder", "write_text"]
