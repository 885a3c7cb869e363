// Values in rows of marks and in maps of the image, under the pointer and by the arrow keys.

function makeTip(element) {
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  element.append(tip);
  return tip;
}

/** Put a tip beside a point of its element, where it has room. */
function place(tip, element, x, y) {
  const left = x + (x > element.clientWidth * 0.6 ? -tip.offsetWidth - 12 : 12);
  tip.style.left = `${Math.max(0, Math.min(left, element.clientWidth - tip.offsetWidth))}px`;
  tip.style.top = `${y}px`;
}

/** Rows of marks: one at a time is told. */
class RowsView {
  constructor(element) {
    this.element = element;
    this.rows = [...element.querySelectorAll(".row:not(.scale)")];
    this.tip = makeTip(element);
    element.tabIndex = 0;
    for (const [number, row] of this.rows.entries()) {
      // The browser's own words would stand beside ours.
      row.marks = [...row.querySelectorAll("circle")].map((mark) => {
        const told = mark.dataset.told;
        mark.querySelector("title").remove();
        return [told, mark.getAttribute("fill"), mark];
      });
      row.addEventListener("click", (event) => this.showBehind(row, event.clientX));
      row.addEventListener("pointermove", () => this.point(number));
    }
    element.addEventListener("pointerleave", () => this.point(null));
    element.addEventListener("blur", () => this.point(null));
    element.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (event.key === "Enter" && this.rows[this.pointed]) this.showBehind(this.rows[this.pointed], 0);
    if (!step) return;
    const next = (this.pointed ?? (step > 0 ? -1 : this.rows.length)) + step;
    this.point(Math.min(Math.max(next, 0), this.rows.length - 1));
    this.rows[this.pointed].scrollIntoView({ block: "nearest" });
    event.preventDefault();
    event.stopPropagation();
  }

  /** Show the frames behind the mark of a row that is nearest to a place on the screen. */
  showBehind(row, x) {
    const far = (mark) => Math.abs(mark.getBoundingClientRect().left - x);
    const known = row.marks.filter(([told, , mark]) => mark.dataset.frames && isShown(told));
    const [nearest] = known.sort(([, , a], [, , b]) => far(a) - far(b));
    if (nearest) showFrames(`${row.querySelector(".name").textContent}, ${nearest[0]}`, nearest[0].slice(0, nearest[0].lastIndexOf(": ")), nearest[2].dataset.frames.split(" ").map(Number));
  }

  point(number) {
    if (this.pointed !== null && this.pointed !== undefined) this.rows[this.pointed].classList.remove("pointed");
    this.pointed = number;
    this.tip.hidden = number === null || !this.rows[number].marks.length;
    if (number === null) return;
    const row = this.rows[number];
    row.classList.add("pointed");
    const lines = row.marks.filter(([told]) => isShown(told)).map(([told, colour]) => {
      const [, name, value] = /^(.*?): ([^:]*)$/s.exec(told) ?? [null, told, ""];
      return tipLine(name, value, colour);
    });
    if (row.marks.some(([, , mark]) => mark.dataset.frames)) lines.push(tipHead("click: the frames behind it", "hint"));
    this.tip.replaceChildren(tipHead(row.querySelector(".name").textContent), ...lines);
    const below = row.offsetTop + row.offsetHeight;
    place(this.tip, this.element, this.element.clientWidth * 0.5, below);
  }
}

/** Maps of one image: the same place is pointed at in all of a figure, and told of all. */
class MapView {
  constructor(element, all) {
    this.element = element;
    this.all = all;
    const { size, runs, title, unit } = JSON.parse(element.dataset.values);
    [this.columns, this.rows] = size;
    [this.title, this.unit] = [title, unit];
    this.cells = new Int16Array(this.columns * this.rows);
    let next = 0;
    for (let run = 0; run < runs.length; run += 2) {
      this.cells.fill(runs[run + 1], next, next + runs[run]);
      next += runs[run];
    }
    this.area = element.querySelector(".area");
    this.cursor = svg("path", { class: "cursor" });
    this.area.append(this.cursor);
    this.area.setAttribute("tabindex", "0");
    this.tip = makeTip(element);
    all.push(this);
    this.area.addEventListener("pointermove", (event) => {
      const box = this.area.getBoundingClientRect();
      const share = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      this.point([Math.floor(share[0] * this.columns), Math.floor(share[1] * this.rows)]);
    });
    this.area.addEventListener("pointerleave", () => this.point(null));
    this.area.addEventListener("blur", () => this.point(null));
    this.area.addEventListener("keydown", (event) => this.key(event));
    this.area.addEventListener("click", () => this.showBehind());
  }

  /** Show the frames with pictures that are wrong at the place pointed at. */
  async showBehind() {
    if (!this.pointed || !browser) return;
    const [outcome, variant] = [this.title.slice(0, 2), this.title.slice(6)];
    const [x, y] = this.pointed;
    const cell = Math.floor(((y + 0.5) / this.rows) * 30) * 40 + Math.floor(((x + 0.5) / this.columns) * 40);
    const show = ({ frames, count }) => {
      const some = frames.length < count ? `: the ${frames.length} with the highest ERR` : "";
      showFrames(`${this.title} here, ${count} of ${browser.pictured(true).length} frames with pictures${some}`, variant, frames);
    };
    if (!browser.live) return show(browser.wrongAt(variant, outcome, cell));
    enlarge(["Looking through the frames \u2026"]);
    const answer = await fetch(`wrong/${cell}`);
    if (!dialog.open) return;
    if (answer.ok) show((await answer.json())[variant]?.[outcome] ?? { frames: [], count: 0 });
    else enlarge([(await answer.text()).trim()]);
  }

  key(event) {
    if (event.key === "Enter") this.showBehind();
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    const [x, y] = this.pointed ?? [this.columns >> 1, this.rows >> 1];
    const wide = event.shiftKey ? 10 : 1;
    this.point([x + wide * step[0], y + wide * step[1]]);
    event.preventDefault();
    event.stopPropagation();
  }

  value(x, y) {
    const tenths = this.cells[y * this.columns + x];
    return tenths < 0 ? "never labelled" : `${(tenths / 10).toFixed(1)} ${this.unit}`;
  }

  point(cell) {
    this.tip.hidden = cell === null;
    if (cell === null) {
      for (const each of this.all) each.cursor.removeAttribute("d");
      return;
    }
    const [x, y] = cell.map((each, axis) => Math.min(Math.max(each, 0), [this.columns, this.rows][axis] - 1));
    this.pointed = [x, y];
    for (const each of this.all) {
      each.cursor.setAttribute("d", `M${x + 0.5} 0V${this.rows}M0 ${y + 0.5}H${this.columns}`);
    }
    const share = [(100 * (x + 0.5)) / this.columns, (100 * (y + 0.5)) / this.rows];
    const head = tipHead(`${share[0].toFixed(0)} % from the left, ${share[1].toFixed(0)} % from the top`);
    const shown = this.all.filter((each) => isShown(each.title.slice(6)));
    this.tip.replaceChildren(head, ...shown.map((each) => tipLine(each.title, each.value(x, y))));
    const box = this.area.getBoundingClientRect();
    place(this.tip, this.element, (box.width * share[0]) / 100, (box.height * share[1]) / 100 + 16);
  }
}

function startPlaces() {
  for (const element of document.querySelectorAll(".rows")) new RowsView(element);
  for (const figure of document.querySelectorAll("figure.charts")) {
    const all = [];
    for (const element of figure.querySelectorAll(".map")) new MapView(element, all);
  }
}
