// The browser of frames: pictures of one frame, and a table of all that can be filtered.

class Browser {
  constructor(element) {
    this.element = element;
    this.strips = element.querySelector(".strips");
    this.absent = element.querySelector(".absent");
    this.rows = [...element.querySelectorAll(".frames tbody tr")];
    this.byFrame = new Map(this.rows.map((row) => [Number(row.dataset.frame), row]));
    this.held = new Map([...this.strips.children].map((strip) => [Number(strip.dataset.frame), strip]));
    this.stage = new Stage(element.querySelector(".stage"), element.dataset.left, element.dataset.right);
    this.tools();
    this.filters();
    for (const row of this.rows) {
      row.addEventListener("click", (event) => {
        event.preventDefault();
        this.show(Number(row.dataset.frame));
      });
    }
    this.strips.addEventListener("click", (event) => {
      const tile = event.target.closest("img")?.closest(".tile");
      if (!tile) return;
      event.stopPropagation();
      this.stage.choose(tile.dataset.name);
      this.stage.toggle();
    });
    range.onChange.push(() => this.filter());
    for (const strip of this.held.values()) strip.hidden = true;
    this.follow(Boolean(location.hash));
    addEventListener("popstate", () => this.follow(true));
  }

  /** Show the frame of the address, or without one the first. */
  follow(scroll) {
    const named = /^#frame-(\d+)$/.exec(location.hash);
    const frame = named ? named[1] : this.element.dataset.first;
    if (frame !== "" && (named || !location.hash || this.frame === undefined)) this.show(Number(frame), { scroll: scroll && Boolean(named), address: null });
  }

  tools() {
    const tools = this.element.querySelector(".tools");
    this.where = tools.querySelector(".where");
    this.previous = tools.querySelector(".previous");
    this.next = tools.querySelector(".next");
    tools.hidden = false;
    this.previous.addEventListener("click", () => this.step(-1));
    this.next.addEventListener("click", () => this.step(1));
    document.addEventListener("keydown", (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      if (event.target.closest("input, select, textarea")) return;
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.step(step);
    });
  }

  /** Frames with pictures, in the drive's order; of the filtered frames, if any of them has some. */
  pictured() {
    const all = this.rows.filter((row) => row.classList.contains("pictured"));
    const shown = all.filter((row) => !row.hidden);
    return (shown.length ? shown : all).map((row) => Number(row.dataset.frame)).sort((a, b) => a - b);
  }

  step(by) {
    const frames = this.pictured();
    const next = by > 0 ? frames.find((number) => number > this.frame) : frames.findLast((number) => number < this.frame);
    if (next !== undefined) this.show(next, { follow: true, address: "replaceState" });
  }

  /** Show a frame; the address names it, as a new step of the history or in place of the last step. */
  show(frame, { scroll = false, follow = false, address = "pushState" } = {}) {
    this.frame = frame;
    if (address && location.hash !== `#frame-${frame}`) history[address](null, "", `#frame-${frame}`);
    this.element.querySelector(".viewer").hidden = false;
    const row = this.byFrame.get(frame);
    for (const other of this.rows) other.removeAttribute("aria-current");
    row?.setAttribute("aria-current", "true");
    if (follow && row) reveal(row);
    for (const view of along) view.mark(frame);
    for (const strip of this.held.values()) strip.hidden = Number(strip.dataset.frame) !== frame;
    this.position();
    const shown = this.held.get(frame);
    this.stage.offer(shown ? [...shown.querySelectorAll(".tile")] : []);
    this.absent.hidden = Boolean(shown);
    if (!shown) this.tellAbsent(frame);
    if (scroll) this.element.querySelector(".viewer").scrollIntoView({ block: "start" });
  }

  position() {
    const frames = this.pictured();
    const place = frames.indexOf(this.frame);
    this.where.textContent = `Frame ${this.frame}` + (place < 0 ? "" : ` \u00b7 ${place + 1} of ${frames.length}`);
    this.previous.disabled = !frames.some((number) => number < this.frame);
    this.next.disabled = !frames.some((number) => number > this.frame);
  }

  tellAbsent(frame) {
    const [command, words] = [this.element.dataset.command.replace("{}", frame), document.createElement("code")];
    words.textContent = command;
    this.absent.replaceChildren("This page holds no pictures of this frame. ", this.byFrame.get(frame)?.dataset.note ?? "");
    const near = this.pictured().sort((a, b) => Math.abs(a - frame) - Math.abs(b - frame))[0];
    if (near !== undefined) {
      const button = document.createElement("button");
      button.textContent = `Frame ${near}, the nearest with pictures`;
      button.addEventListener("click", () => this.show(near, { follow: true }));
      this.absent.append(" ", button);
    }
    if (command) this.absent.append(" In the viewer: ", words);
  }

  filters() {
    const form = this.element.querySelector(".filters");
    this.form = form;
    this.count = form.querySelector("output");
    this.columns = [...this.element.querySelectorAll(".frames thead tr:last-child th")];
    form.hidden = false;
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("input", () => this.filter());
    form.addEventListener("reset", () => {
      setTimeout(() => {
        if (range.drive) zoom(...range.drive);
        else this.filter();
      });
    });
  }

  filter() {
    const limits = Object.fromEntries(new FormData(this.form));
    const [least, most] = [limits.least, limits.most].map((text) => (text ? Number(text) : NaN));
    const places = this.columns.flatMap((title, place) => {
      const { variant, rate } = title.dataset;
      return rate === limits.rate && isShown(variant) ? [place] : [];
    });
    const fits = (value) => !(value < least) && !(value > most) && !(Number.isNaN(value) && (least >= 0 || most >= 0));
    for (const row of this.rows) {
      const frame = Number(row.dataset.frame);
      const inRate = !places.length || places.some((place) => fits(numberOf(row.cells[place].textContent)));
      const inRange = !range.drive || (frame >= range.low && frame <= range.high) || range.low === range.high;
      row.hidden = !(inRate && inRange && hasCondition(row, limits.condition));
    }
    this.hideColumns();
    const shown = this.rows.filter((row) => !row.hidden).length;
    this.count.textContent = shown === this.rows.length ? "" : `${shown} of ${this.rows.length} frames`;
    if (this.frame !== undefined) this.position();
  }

  /** Show only the chosen variants' columns. */
  hideColumns() {
    for (const [place, title] of this.columns.entries()) {
      title.hidden = !isShown(title.dataset.variant);
      for (const row of this.rows) row.cells[place].hidden = title.hidden;
    }
    const shown = this.columns.filter((title) => title.dataset.variant && !title.hidden);
    const columns = new Set(shown.map((title) => title.dataset.variant)).size;
    for (const group of this.element.querySelectorAll(".frames .groups th")) group.colSpan = columns;
  }
}

function hasCondition(row, condition) {
  if (!condition) return true;
  if (condition === "pictured") return row.classList.contains("pictured");
  return (row.dataset.conditions ?? "").split(" ").includes(condition);
}

/** Scroll a row into sight within its table, and leave the page where it is. */
function reveal(row) {
  const box = row.closest(".scroll");
  const head = row.closest("table").tHead.offsetHeight;
  const [top, bottom] = [row.offsetTop - head, row.offsetTop + row.offsetHeight];
  if (top < box.scrollTop) box.scrollTop = top;
  else if (bottom > box.scrollTop + box.clientHeight) box.scrollTop = bottom - box.clientHeight;
}
