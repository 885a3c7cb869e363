// Tables that sort by a click on a column's title, and fields that search long tables.

/** A new element with its properties. */
const make = (tag, properties) => Object.assign(document.createElement(tag), properties);

const MOST_ROWS = 3; // Fewer rows need no sorting.

/** The number at the beginning of a cell's text, as people write it; NaN without one. */
function numberOf(text) {
  const plain = text.trim().replaceAll(",", "").replaceAll("\u2212", "-");
  return /^[-+]?[\d.]/.test(plain) ? parseFloat(plain) : NaN;
}

function compare(a, b) {
  const [x, y] = [numberOf(a), numberOf(b)];
  if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
  return a.localeCompare(b, undefined, { numeric: true });
}

/** Whether a cell is empty; such rows are last in both directions. */
const isEmpty = (text) => ["", "\u2013", "none given"].includes(text.trim());

function sort(table, column, descending) {
  const body = table.tBodies[0];
  const text = (row) => row.cells[column].textContent;
  const rank = (row) => (row.classList.contains("total") ? 2 : Number(isEmpty(text(row))));
  const order = (a, b) => rank(a) - rank(b) || (rank(a) ? 0 : (descending ? -1 : 1) * compare(text(a), text(b)));
  body.append(...[...body.rows].sort(order));
  for (const row of body.querySelectorAll(".rule:not(.total)")) row.classList.remove("rule");
  table.classList.add("sorted");
}

function makeSortable(table) {
  if (table.tBodies[0].rows.length < MOST_ROWS) return;
  const titles = [...table.tHead.rows[table.tHead.rows.length - 1].cells];
  for (const [column, title] of titles.entries()) {
    if (!title.textContent.trim()) continue;
    const button = make("button", { type: "button" });
    button.append(...title.childNodes);
    title.append(button);
    button.addEventListener("click", () => {
      // Words from a to z at first, numbers from the highest.
      const first = title.classList.contains("t") || column === 0 ? "ascending" : "descending";
      const other = first === "ascending" ? "descending" : "ascending";
      const order = title.getAttribute("aria-sort") === first ? other : first;
      for (const other of titles) other.removeAttribute("aria-sort");
      title.setAttribute("aria-sort", order);
      sort(table, column, order === "descending");
    });
  }
}

function makeSearchable(long) {
  const [field, count] = [long.querySelector("input"), long.querySelector("output")];
  const rows = [...long.querySelector("tbody").rows];
  long.querySelector(".find").hidden = false;
  field.addEventListener("input", () => {
    const words = field.value.trim().toLowerCase().split(/\s+/);
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
    }
    const shown = rows.filter((row) => !row.hidden).length;
    count.textContent = shown === rows.length ? "" : `${shown} of ${rows.length}`;
  });
}
