// A click on the title of a column sorts its table. A field searches a long table.

/** Return a new element with its properties. */
const make = (tag, properties) => Object.assign(document.createElement(tag), properties);

const LEAST_ROWS = 3; // A table with fewer rows needs no sorting.

/** Return the number at the beginning of a cell's text, or NaN if there is none. */
function numberOf(text) {
  const plain = text.trim().replaceAll(",", "").replaceAll("\u2212", "-");
  return /^[-+]?[\d.]/.test(plain) ? parseFloat(plain) : NaN;
}

/** Compare two texts: by their numbers if both begin with one, else by their letters. */
function compare(a, b) {
  const [x, y] = [numberOf(a), numberOf(b)];
  if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
  return a.localeCompare(b, undefined, { numeric: true });
}

/** Return whether a cell is empty. Rows with an empty cell come last in both directions. */
const isEmpty = (text) => ["", "\u2013", "none given"].includes(text.trim());

/** Sort the rows of a table by a column. Rows with totals stay at the end. */
function sort(table, column, descending) {
  const body = table.tBodies[0];
  const text = (row) => row.cells[column].textContent;
  const rank = (row) => (row.classList.contains("total") ? 2 : Number(isEmpty(text(row))));
  const order = (a, b) => rank(a) - rank(b) || (rank(a) ? 0 : (descending ? -1 : 1) * compare(text(a), text(b)));
  body.append(...[...body.rows].sort(order));
  for (const row of body.querySelectorAll(".rule:not(.total)")) row.classList.remove("rule");
  table.classList.add("sorted");
}

/** Make the titles of a table buttons that sort it. */
function makeSortable(table) {
  if (table.tBodies[0].rows.length < LEAST_ROWS) return;
  const titles = [...table.tHead.rows[table.tHead.rows.length - 1].cells];
  for (const [column, title] of titles.entries()) {
    if (!title.textContent.trim()) continue;
    const button = make("button", { type: "button" });
    button.append(...title.childNodes);
    title.append(button);
    button.addEventListener("click", () => {
      // The first click sorts words from a to z, and numbers from the highest.
      const first = title.classList.contains("t") || column === 0 ? "ascending" : "descending";
      const other = first === "ascending" ? "descending" : "ascending";
      const order = title.getAttribute("aria-sort") === first ? other : first;
      for (const other of titles) other.removeAttribute("aria-sort");
      title.setAttribute("aria-sort", order);
      sort(table, column, order === "descending");
    });
  }
}

/** Show only the rows that contain all words of the field. */
function makeSearchable(part) {
  const [field, count] = [part.querySelector("input"), part.querySelector("output")];
  const rows = [...part.querySelector("tbody").rows];
  part.querySelector(".find").hidden = false;
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
