"""The words in PDF files and recordings, by other people's readers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import pypdf
from rerun.chunk import RrdReader

KINDS: Final = {1: "tabs", 2: "beside each other", 3: "below each other", 4: "grid"}
"""The containers of the viewer, by Rerun's number."""


# --- PDF ------------------------------------------------------------------------------------------


def pages(path: Path) -> list[str]:
    """The text of each page."""
    return [page.extract_text() for page in pypdf.PdfReader(path).pages]


def paged(path: Path) -> str:
    """A document's titles, its outline, and its text page by page."""
    reader = pypdf.PdfReader(path)
    kept = ("/Title", "/Author", "/Keywords")
    lines = [f"{name[1:]}: {reader.metadata.get(name)}" for name in kept]
    lines += ["=== outline", *_outline(reader, reader.outline)]
    for number, text in enumerate(pages(path), 1):
        lines += [f"=== page {number}", text]
    return "\n".join(lines)


def _outline(reader: pypdf.PdfReader, entries: list[Any], indent: str = "") -> Iterator[str]:
    for entry in entries:
        if isinstance(entry, list):
            yield from _outline(reader, entry, f"{indent}    ")
        else:
            page = reader.get_destination_page_number(entry)
            yield f"{indent}{entry.title}, page {(page or 0) + 1}"


def bold(path: Path, page: int) -> list[str]:
    """What stands in bold on a page, from 1, piece by piece."""
    pieces: list[str] = []

    def visit(text: str, _matrix: Any, _text: Any, font: dict[str, Any] | None, _size: Any) -> None:
        if text.strip() and font and "Bold" in str(font["/BaseFont"]).replace("Semibold", ""):
            pieces.append(text.strip())

    pypdf.PdfReader(path).pages[page - 1].extract_text(visitor_text=visit)
    return pieces


# --- Recordings -----------------------------------------------------------------------------------


def documents(path: Path) -> dict[str, str]:
    """The texts of a recording, by their paths."""
    return {
        place: columns["TextDocument:text"][0][0]
        for place, columns, is_static in _chunks(path, "recordings")
        if is_static and "TextDocument:text" in columns
    }


def by_frame(path: Path, component: str) -> dict[str, list[tuple[int, Any]]]:
    """The values of a component, by path: frames and what they have."""
    found: dict[str, list[tuple[int, Any]]] = {}
    for place, columns, is_static in _chunks(path, "recordings"):
        if component in columns and not is_static:
            rows = zip(columns["frame"], columns[component], strict=True)
            found.setdefault(place, []).extend((frame, value) for frame, value in rows if value)
    return {place: sorted(rows, key=lambda row: row[0]) for place, rows in sorted(found.items())}


def words(path: Path) -> str:
    """What the viewer shows in words: guide, notes, states, the lines' names."""
    lines: list[str] = []
    for place, text in sorted(documents(path).items()):
        if place.startswith("/results/guide"):
            lines += [f"=== {place}", text]
    lines.append("=== how each line is drawn")
    for place, columns, is_static in sorted(_chunks(path, "recordings"), key=lambda c: c[0]):
        if is_static and (style := _style(columns)):
            lines.append(f"{place}: {style}")
    for component in ("TextLog:text", "StateChange:state"):
        for place, rows in by_frame(path, component).items():
            lines.append(f"=== {place}")
            lines += [f"frame {frame}: {'; '.join(map(str, value))}" for frame, value in rows]
    return "\n".join(lines)


def screen(path: Path) -> str:
    """How the viewer arranges its views, as an indented tree."""
    parts: dict[str, dict[str, Any]] = {}
    for place, columns, _ in _chunks(path, "blueprints"):
        parts.setdefault(place, {}).update(columns)
    (root,) = parts["/viewport"]["ViewportBlueprint:root_container"][0]
    hexed = bytes(root).hex()
    ends = (8, 12, 16, 20, 32)
    uuid = "-".join(hexed[a:b] for a, b in zip((0, *ends), ends, strict=False))
    lines = [*_tree(f"/container/{uuid}", parts, ""), "time panel"]
    for name, value in sorted(parts["/time_panel"].items()):
        if ":" in name:
            lines.append(f"    {name.partition(':')[2]}: {value[0]}")
    return "\n".join(lines)


def _tree(place: str, parts: dict[str, dict[str, Any]], indent: str) -> Iterator[str]:
    own = {name.partition(":")[2]: value[0] for name, value in parts[place].items() if value[0]}
    title = own.get("display_name", [""])[0]
    if place.startswith("/view/"):
        query = parts[f"{place}/ViewContents"]["ViewContents:query"][0]
        yield f"{indent}{own['class_identifier'][0]} {title!r}: {' '.join(query)}"
        return
    shares = own.get("col_shares") or own.get("row_shares") or ()
    columns = f" of {own['grid_columns'][0]} columns" if "grid_columns" in own else ""
    yield f"{indent}{KINDS[own['container_kind'][0]]}{columns} {title!r}{_shares(shares)}"
    for inner in own["contents"]:
        yield from _tree(f"/{inner}", parts, f"{indent}    ")


def _shares(shares: Sequence[float]) -> str:
    return f" ({', '.join(f'{share:.0f}' for share in shares)})" if shares else ""


def _style(columns: dict[str, list[Any]]) -> str:
    told = []
    for name, rows in sorted(columns.items()):
        kind, _, field = name.partition(":")
        if kind in ("SeriesLines", "StateConfiguration") and rows[0]:
            values = [f"#{v:08X}" if field == "colors" else str(v) for v in rows[0]]
            told.append(f"{field} {' '.join(values)}")
    return ", ".join(told)


def _chunks(path: Path, kind: str) -> Iterator[tuple[str, dict[str, list[Any]], bool]]:
    """Yield every chunk's entity path, its columns by name, and whether it is of no time."""
    reader = RrdReader(path)
    (entry,) = getattr(reader, kind)()
    for chunk in reader.stream(store=entry):
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if ":" in name or name == "frame"]
        columns = {name: batch.column(name).to_pylist() for name in names if "blob" not in name}
        yield chunk.entity_path, columns, chunk.is_static
