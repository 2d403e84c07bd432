"""One self-contained HTML page that shows a diagnosis: no network, pictures and data inline.

from dualdrive.report import Provenance, page

html = page(diagnosis, ladder=ladder, provenance=Provenance.of(machine, ["fit.csv"]))
"""

from __future__ import annotations

from dualdrive.report.document import page
from dualdrive.report.provenance import Provenance, Source

__all__ = ["Provenance", "Source", "page"]
