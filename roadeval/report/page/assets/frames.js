// The browser of frames shows a film of the drive, facts about one frame, and a table of all frames.

class Browser {
  constructor(element) {
    this.element = element;
    this.data = JSON.parse(element.dataset.drive);
    this.strips = element.querySelector(".strips");
    this.rows = [...element.querySelectorAll(".frames tbody tr")];
    this.rowByFrame = new Map(this.rows.map((row) => [Number(row.dataset.frame), row]));
    this.stripByFrame = new Map([...this.strips.children].map((strip) => [Number(strip.dataset.frame), strip]));
    this.placeByFrame = new Map(this.data.frames.map((frame, place) => [frame, place]));
    this.about = element.querySelector(".about");
    this.ratesTable = document.querySelector("table[data-name=rates]");
    this.verdict = document.querySelector(".verdict");
    this.verdictOfDrive = this.verdict.textContent;
    if (this.data.film) {
      const { film, colours } = this.data;
      this.film = new Film(element.dataset.film, film, colours, (frame) => {
        if (this.film.playing) this.show(frame, { follow: true, address: null });
        this.stage.draw();
      });
      this.stage = new Stage(element.querySelector(".stage"), this.film);
      element.classList.add("filmed");
      // If the web browser cannot play the film, the page shows the pictures of the worst frames.
      this.film.video.addEventListener("error", () => {
        element.classList.remove("filmed");
        for (const part of [this.stage.element, this.playButton]) part.hidden = true;
      });
    }
    this.tools();
    this.filters();
    this.threshold();
    document.addEventListener("click", (event) => {
      const [row, link] = [".frames tbody tr", 'a[href^="#frame-"]'].map((part) => event.target.closest(part));
      if (!row && !link) return;
      event.preventDefault();
      if (row) this.show(Number(row.dataset.frame));
      else this.show(Number(link.hash.slice("#frame-".length)), { scroll: true });
    });
    for (const image of this.strips.querySelectorAll("img")) image.addEventListener("click", () => enlargePicture(image));
    range.frames = this.data.frames;
    range.onChange.push(() => this.narrow());
    for (const strip of this.stripByFrame.values()) strip.hidden = true;
    startChoice(this.data.focus, () => this.chosen());
    this.follow(Boolean(location.hash));
    addEventListener("popstate", () => this.follow(true));
  }

  /** Show what the address names: a frame, the focus, a part of the drive and a threshold. */
  follow(scroll) {
    const { place, frame, focus, beside, range: part, threshold } = readAddress();
    if (place && frame === null && this.frame !== undefined) return;
    const names = this.data.variants;
    choose(names.includes(focus) ? focus : this.data.focus, names.includes(beside) || beside === "-" ? beside : "", () => this.chosen(false));
    const ends = /^(\d+)-(\d+)$/.exec(part ?? "");
    if (range.drive) zoom(...(ends ? ends.slice(1).map(Number) : range.drive));
    this.setLevel(threshold ? Math.min(Math.max(Math.round(threshold) || 1, 1), 255) : undefined);
    const worst = this.data.worst[choice.focus]?.[0] ?? Number(this.element.dataset.first);
    this.show(this.placeByFrame.has(frame) ? frame : worst, { scroll: scroll && frame !== null, address: null });
  }

  /** Make the buttons and keys step through the frames and play the film. */
  tools() {
    const tools = this.element.querySelector(".tools");
    const names = [".where", ".previous", ".next", ".play"];
    [this.where, this.previous, this.next, this.playButton] = names.map((name) => tools.querySelector(name));
    tools.hidden = false;
    this.previous.addEventListener("click", () => this.step(-1));
    this.next.addEventListener("click", () => this.step(1));
    this.playButton?.addEventListener("click", () => this.toggle());
    document.addEventListener("keydown", (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      if (event.target.closest("input, select, textarea, button, summary, a")?.matches(event.key === " " ? "*" : "input, select, textarea")) return;
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (step) this.step(step);
      else if (event.key === " " && this.film) this.toggle();
      else return;
      event.preventDefault();
    });
  }

  /** Return the frames to step through, within the chosen part: the frames of the film, or else the frames with pictures. */
  shown() {
    const all = this.film ? this.film.frames : [...this.stripByFrame.keys()].sort((a, b) => a - b);
    const inside = all.filter(isInRange);
    return inside.length ? inside : all;
  }

  /** Show the next frame, or the frame before. */
  step(by) {
    const frames = this.shown();
    const next = by > 0 ? frames.find((number) => number > this.frame) : frames.findLast((number) => number < this.frame);
    if (next !== undefined) this.show(next, { follow: true, address: "replaceState" });
  }

  /** Stop the film, or play it from this frame. After the last frame it begins again. */
  toggle() {
    const [frames, button] = [this.shown(), this.playButton];
    if (this.film.playing) return this.film.pause();
    if (this.frame >= frames.at(-1)) this.show(frames[0]);
    button.textContent = "Pause";
    this.film.play(frames.at(-1), () => {
      button.textContent = "Play";
      this.show(this.frame, { address: "replaceState" });
    });
  }

  /** Show a frame. `address` names the method of the history that writes it into the address. */
  show(frame, { scroll = false, follow = false, address = "pushState" } = {}) {
    this.frame = frame;
    if (address) this.writeAddress(address);
    const row = this.rowByFrame.get(frame);
    for (const other of this.rows) other.removeAttribute("aria-current");
    row?.setAttribute("aria-current", "true");
    if (follow && row) reveal(row);
    for (const view of driveCharts) view.mark(frame);
    for (const strip of this.stripByFrame.values()) strip.hidden = Number(strip.dataset.frame) !== frame;
    this.position();
    this.tell(row);
    if (this.film && !this.film.playing) this.film.seek(frame);
    if (scroll) this.element.querySelector(".viewer").scrollIntoView({ block: "start" });
  }

  /** Write the frame and the choices into the address. */
  writeAddress(step = "replaceState") {
    const level = this.film?.levels[choice.focus];
    const part = isPart() ? `${Math.ceil(range.low)}-${Math.floor(range.high)}` : "";
    const focus = choice.focus === this.data.focus ? "" : choice.focus;
    writeAddress(this.frame, { focus, beside: choice.beside, range: part, threshold: level }, step);
  }

  /** Show the number of the frame, and enable the buttons that lead to others. */
  position() {
    const frames = this.shown();
    const place = frames.indexOf(this.frame);
    const isFilmed = !this.film || this.film.places.has(this.frame);
    this.element.classList.toggle("unfilmed", !isFilmed);
    this.where.textContent = `Frame ${this.frame}${isFilmed ? "" : " (not in the video)"}` + (place < 0 ? "" : ` \u00b7 ${place + 1} of ${frames.length}`);
    this.previous.disabled = !frames.some((number) => number < this.frame);
    this.next.disabled = !frames.some((number) => number > this.frame);
  }

  /** Return the counts of a variant on a frame; undefined if it was not scored. */
  countsOf(variant, frame) {
    return this.data.counts[variant]?.[this.placeByFrame.get(frame)];
  }

  /** Show the rates of this frame, its conditions, and the command that opens it. */
  tell(row) {
    const [table, names] = [this.about.querySelector("table"), Object.keys(this.data.counts)];
    const scored = names.filter((name) => this.countsOf(name, this.frame) && isShown(name));
    const cells = (tag, texts) => {
      const line = make("tr");
      line.append(...texts.map((text, place) => make(place ? tag : "th", { textContent: text, scope: place ? "" : tag === "th" ? "col" : "row" })));
      const dot = this.ratesTable?.querySelector(`tr[data-of="${CSS.escape(texts[0])}"] .dot`);
      if (dot) line.cells[0].prepend(dot.cloneNode(true));
      return line;
    };
    const rates = ["ERR", "FPR", "FNR"];
    table.hidden = !scored.length;
    table.tHead.replaceChildren(cells("th", ["this frame, %", ...rates]));
    table.tBodies[0].replaceChildren(
      ...scored.map((name) => cells("td", [name, ...rates.map((rate) => percent(RATES[rate](this.countsOf(name, this.frame))))])),
    );
    const sentences = this.stripByFrame.get(this.frame)?.querySelectorAll(".two .note") ?? [];
    this.about.querySelector(".words").textContent = [...sentences].map((p) => p.textContent.replace(/\.?$/, ".")).join(" ") || (row?.dataset.note ?? "");
    const command = this.about.querySelector(".open code");
    if (command) command.textContent = this.element.dataset.command.replace("{}", this.frame);
  }

  /** Show the chosen focus and the variant beside it in all parts of the page. */
  chosen(isNew = true) {
    const others = this.data.variants.filter((name) => name !== choice.focus && name !== "blind");
    for (const part of document.querySelectorAll("[data-focus]")) part.hidden = part.dataset.focus !== choice.focus;
    this.stage?.prefer([choice.focus, choice.beside || others[0]]);
    for (const view of driveCharts) view.show(view.low, view.high);
    this.filter();
    this.judge();
    this.setLevel(this.film?.levels[choice.focus]);
    const worst = this.data.worst[choice.focus] ?? [];
    const links = this.about.querySelector(".worst");
    links.replaceChildren(worst.length ? `Worst frames of ${choice.focus}: ` : "", ...worst.map((frame) => this.frameButton(frame)));
    if (isNew && worst.length) this.show(worst[0], { address: "replaceState" });
  }

  /** Return a button that shows a frame. */
  frameButton(frame) {
    const button = make("button", { type: "button", textContent: frame });
    button.addEventListener("click", () => this.show(frame, { follow: true }));
    return button;
  }

  /** Show the frames, the rates and the verdict of the chosen part of the drive. */
  narrow() {
    this.filter();
    this.judge();
    if (this.frame === undefined) return;
    const worst = this.worstOf(this.shown());
    if (!isInRange(this.frame) && worst !== undefined) this.show(worst, { address: null });
    this.writeAddress();
  }

  /** Return the error rate of the focus on a frame. */
  errorOf(frame) {
    return RATES.ERR(this.countsOf(choice.focus, frame));
  }

  /** Return the frame with the highest error rate of the focus; undefined if no frame was scored. */
  worstOf(frames) {
    const scored = frames.filter((frame) => this.countsOf(choice.focus, frame));
    return scored.reduce((worst, frame) => (this.errorOf(frame) > this.errorOf(worst) ? frame : worst), scored[0]);
  }

  /** Show the verdict on the focus, for the whole drive or for the chosen part. */
  judge() {
    const { words, counts, frames, verdicts } = this.data;
    const countsIn = (name) => counts[name].filter((frame, place) => frame && isInRange(frames[place]));
    const [inside, ofFocus] = [frames.filter(isInRange), counts[choice.focus]];
    const rates = (name) => Object.fromEntries(["ERR", "FNR", "FPR"].map((rate) => [rate, percent(meanRate(rate, countsIn(name)), 1)]));
    this.verdict.textContent = choice.focus === this.data.focus ? this.verdictOfDrive : (verdicts[choice.focus]?.replaceAll("`", "") ?? this.verdictOfDrive);
    if (isPart() && ofFocus) {
      const others = Object.keys(counts).filter((name) => name !== choice.focus && isShown(name));
      const sentences = others.map((name) => fill(words["error of a range"], { variant: name, ...rates(name) })).join(" ");
      const facts = { first: inside[0], last: inside.at(-1), frames: inside.length, variant: choice.focus, others: sentences };
      this.verdict.textContent = fill(words["verdict of a range"], { ...facts, ...rates(choice.focus) });
    }
    const link = document.querySelector("#summary .links a");
    const worst = this.worstOf(inside);
    if (link && worst !== undefined) {
      link.textContent = fill(words["worst frame"], { frame: worst, variant: choice.focus, ERR: percent(this.errorOf(worst), 1) });
      link.hash = `#frame-${worst}`;
      const command = document.querySelector("#summary .links code");
      if (command) command.textContent = this.element.dataset.command.replace("{}", worst);
    }
    if (this.ratesTable) narrowRates(this.ratesTable, words["rates of a range"], isPart() ? (name) => counts[name] && countsIn(name) : null);
  }

  /** Let the reader move the threshold on the probability of the focus. */
  threshold() {
    this.thresholdBox = this.about.querySelector(".threshold");
    if (!this.thresholdBox) return;
    const [input, button] = [this.thresholdBox.querySelector("input"), this.thresholdBox.querySelector("button")];
    const set = (level) => {
      this.setLevel(level);
      this.writeAddress();
    };
    input.addEventListener("input", () => set(Number(input.value)));
    button.addEventListener("click", () => set(undefined));
  }

  /** Show the picture, the rates and the line of a configuration for a threshold; undefined restores the threshold of the run. */
  setLevel(level) {
    const slider = this.data.thresholds[choice.focus];
    if (!this.thresholdBox) return;
    this.thresholdBox.hidden = !slider;
    if (!slider) return;
    if (this.film) {
      this.film.levels[choice.focus] = level;
      this.stage.draw();
    }
    // A level holds 256 of the 65536 codes of a probability. Pixels above a code are road.
    const code = level === undefined ? Math.round(slider.now * 65535) : 256 * level - 1;
    const shown = Math.round((code + 1) / 256);
    const [above, below] = [(counts) => counts.slice(shown), (counts) => counts.slice(0, shown)].map((part) => (counts) => part(counts).reduce((sum, count) => sum + count, 0));
    const moved = [above(slider.road), below(slider.other), above(slider.other), below(slider.road)];
    const counts = level === undefined ? slider.counts : moved;
    const rates = Object.fromEntries(["ERR", "FPR", "FNR"].map((rate) => [rate, percent(RATES[rate](counts))]));
    const threshold = level === undefined ? slider.now : ((code + (slider.reached ? 0.5 : 0)) / 65535).toFixed(5);
    const [label, input, note, line] = ["label", "input", "p", "code"].map((name) => this.thresholdBox.querySelector(name));
    const stage = slider.stage === choice.focus ? "" : ` (${slider.stage})`;
    label.textContent = `Threshold of ${choice.focus}${stage}: ${threshold}`;
    input.setAttribute("aria-label", label.textContent);
    input.value = shown;
    note.textContent = fill(this.data.words["rates of a threshold"], rates);
    line.textContent = slider.line.replace("{}", threshold);
  }

  /** Make the form filter the table of frames. */
  filters() {
    const form = this.element.querySelector(".filters");
    this.form = form;
    this.count = form.querySelector("output");
    this.columns = [...this.element.querySelectorAll(".frames thead tr:last-child th")];
    form.hidden = false;
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("input", () => this.filter());
    const clear = () => (range.drive ? zoom(...range.drive) : this.filter());
    form.addEventListener("reset", () => setTimeout(clear));
  }

  /** Show the rows of the table that fit the form and lie in the chosen part. */
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
      row.hidden = !(inRate && isInRange(frame) && hasCondition(row, limits.condition));
    }
    this.hideColumns();
    const shown = this.rows.filter((row) => !row.hidden).length;
    this.count.textContent = shown === this.rows.length ? "" : `${shown} of ${this.rows.length} frames`;
    if (this.frame !== undefined) this.position();
  }

  /** Show only the columns of the chosen variants. */
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

/** Return whether a frame lies in the chosen part of the drive. */
function isInRange(frame) {
  return !range.drive || (frame >= range.low && frame <= range.high);
}

/** Put the rates of some frames into the table of the drive. Without `countsOf` the rates of the whole drive return. */
function narrowRates(table, words, countsOf) {
  table.caption.dataset.drive ??= table.caption.textContent;
  table.caption.textContent = countsOf ? words : table.caption.dataset.drive;
  const titles = [...table.tHead.rows[table.tHead.rows.length - 1].cells].map((cell) => cell.textContent.replace(/[^\w ]/g, "").trim());
  table.classList.toggle("narrow", Boolean(countsOf));
  for (const row of table.tBodies[0].rows) {
    const counts = countsOf?.(row.cells[0].textContent);
    for (const [place, cell] of [...row.cells].entries()) {
      if (!place) continue;
      const text = cell.querySelector("b") ?? cell;
      cell.dataset.drive ??= text.textContent;
      const rate = counts ? rateOfColumn(titles[place], counts) : undefined;
      text.textContent = !countsOf ? cell.dataset.drive : rate === undefined ? "\u2013" : percent(rate);
    }
  }
}

/** Return whether a frame has a condition, or pictures. */
function hasCondition(row, condition) {
  return !condition || row.classList.contains(condition) || (row.dataset.conditions ?? "").split(" ").includes(condition);
}

/** Scroll a table until a row of it is visible; the page does not move. */
function reveal(row) {
  const box = row.closest(".scroll");
  const head = row.closest("table").tHead.offsetHeight;
  const [top, bottom] = [row.offsetTop - head, row.offsetTop + row.offsetHeight];
  if (top < box.scrollTop) box.scrollTop = top;
  else if (bottom > box.scrollTop + box.clientHeight) box.scrollTop = bottom - box.clientHeight;
}
