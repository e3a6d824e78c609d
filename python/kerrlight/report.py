"""Pages that fits, posteriors and comparisons write."""

from __future__ import annotations

import html
from pathlib import Path

__all__ = ["Report"]


class Report:
    """A page, such as that of a fit with its interactive view of the volume. In a notebook it shows itself."""

    def __init__(self, path: Path) -> None:
        self.path = path
        """Path of the page."""

    def open(self) -> bool:
        """Shows it in a browser."""
        import webbrowser

        return webbrowser.open(self.path.resolve().as_uri())

    def _repr_html_(self) -> str:
        page = html.escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" width="100%" height="800" style="border: 0"></iframe>'

    def __repr__(self) -> str:
        return f"<Report {self.path}>"
