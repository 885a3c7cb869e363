// The pointer and the arrow keys show the values of a row of marks.

/** Return a hidden box for values, inside an element. */
function makeTip(element) {
  const tip = make("div", { className: "tip", hidden: true });
  element.append(tip);
  return tip;
}

/** Place a box beside a point of its element, on the side that has room. */
function place(tip, element, x, y) {
  const left = x + (x > element.clientWidth * 0.6 ? -tip.offsetWidth - 12 : 12);
  tip.style.left = `${Math.max(0, Math.min(left, element.clientWidth - tip.offsetWidth))}px`;
  tip.style.top = `${y}px`;
}

/** A chart of rows of marks. It shows the values of one row at a time. */
class RowsView {
  constructor(element) {
    this.element = element;
    this.rows = [...element.querySelectorAll(".row:not(.scale)")];
    this.tip = makeTip(element);
    element.tabIndex = 0;
    for (const [number, row] of this.rows.entries()) {
      row.marks = [...row.querySelectorAll("[data-text]")].map((mark) => [mark.dataset.text, mark]);
      row.addEventListener("pointermove", () => this.point(number));
    }
    for (const end of ["pointerleave", "blur"]) element.addEventListener(end, () => this.point(null));
    element.addEventListener("keydown", (event) => this.key(event));
  }

  /** Move to the row above or below. */
  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!step) return;
    const next = (this.pointed ?? (step > 0 ? -1 : this.rows.length)) + step;
    this.point(Math.min(Math.max(next, 0), this.rows.length - 1));
    this.rows[this.pointed].scrollIntoView({ block: "nearest" });
    event.preventDefault();
    event.stopPropagation();
  }

  /** Show the values of a row; null hides them. */
  point(number) {
    this.rows[this.pointed]?.classList.remove("pointed");
    this.pointed = number;
    this.tip.hidden = number === null || !this.rows[number].marks.length;
    if (number === null) return;
    const row = this.rows[number];
    row.classList.add("pointed");
    const lines = row.marks.filter(([text]) => isShown(text)).map(([text, mark]) => {
      const [, name, value] = /^(.*?): ([^:]*)$/s.exec(text) ?? [null, text, ""];
      return tipLine(name, value, mark);
    });
    this.tip.replaceChildren(make("p", { className: "head", textContent: row.querySelector(".name").textContent }), ...lines);
    const below = row.offsetTop + row.offsetHeight;
    place(this.tip, this.element, this.element.clientWidth * 0.5, below);
  }
}

function startPlaces() {
  for (const element of document.querySelectorAll(".rows")) new RowsView(element);
}
