"""Made-up runs, for the tests of the claims that compare them."""

from __future__ import annotations

from cmg_mj.results.result import Outcome, Result


def make_result(errors: list[float], *, fell: int = 0, tilts: list[float] | None = None) -> Result:
    """Make worlds with these velocity errors, of which the last ones fell; the tilts are the errors if not given."""
    kinds = ["done"] * (len(errors) - fell) + ["fell"] * fell
    rows = zip(errors, tilts or errors, strict=True)
    summaries = [{"velocity_rms_error_rad_s": error, "tilt_rms_deg": tilt} for error, tilt in rows]
    return Result([Outcome(kind, 5.0) for kind in kinds], summaries)  # type: ignore[arg-type]
