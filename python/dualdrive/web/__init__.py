"""What browsers are given: the modules of ``page/``, shared by the workbench and saved reports.

    modules    the files by name, the import map, the policies under which a browser runs them
    live       plots of a saved report: series and panels as a page holds them

No build step: a module is loaded as it is written. The server gives out files; a saved report
carries the same files as data in its import map.
"""

from __future__ import annotations

from dualdrive.web.live import Live

__all__ = ["Live"]
