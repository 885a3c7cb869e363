// The charts show the values under the pointer. All charts along the drive show the same range of frames.

const SVG = "http://www.w3.org/2000/svg";
const driveCharts = []; // These charts lie along the drive.
const range = { drive: null, low: 0, high: 0, frames: null, onChange: [] };

/** Return a new SVG element with its attributes and its text. */
function svg(name, attributes, text = "") {
  const element = document.createElementNS(SVG, name);
  element.textContent = text;
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

/** Return the place of the number that is nearest to a value. */
function nearest(numbers, value) {
  const distance = (place) => Math.abs(numbers[place] - value);
  return numbers.reduce((best, _, place) => (distance(place) < distance(best) ? place : best), 0);
}

/** Return about `count` round numbers in a range, which are at least `least` apart. */
function roundNumbers(low, high, count, least = 1) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = Math.max(least, power * [1, 2, 5, 10].find((digit) => digit * power >= rough));
  const numbers = [];
  for (let number = Math.ceil(low / step) * step; number <= high; number += step) numbers.push(number);
  return numbers;
}

/** Return a line with a variant's mark, a name and its value. */
function tipLine(name, value, mark = null) {
  const line = make("p");
  if (mark) {
    const dot = svg("svg", { class: "dot", viewBox: "-6 -6 12 12" });
    dot.append(mark.cloneNode());
    line.append(dot);
  }
  line.append(name, make("b", { textContent: value }));
  return line;
}

/** Return a value as text, with its interval if it has one. */
function withEnds(value, low, high, unit) {
  if (value === null || value === undefined) return "\u2013";
  const written = (number) => `${unit === "points" && number > 0 ? "+" : ""}${number.toFixed(2)}`.replace("-", "\u2212");
  const hasEnds = typeof low === "number" && typeof high === "number";
  return `${written(value)} ${unit}` + (hasEnds ? ` (${written(low)} to ${written(high)})` : "");
}

/** A chart with values on the y axis. */
class ChartView {
  constructor(element, onFrame) {
    this.element = element;
    this.values = JSON.parse(element.dataset.values);
    this.numbers = [...new Set(this.values.series.flatMap((series) => series.x))].sort((a, b) => a - b);
    this.area = element.querySelector(".area");
    [this.low, this.high] = this.values.x;
    this.cursor = svg("path", { class: "cursor" });
    this.here = svg("path", { class: "here" });
    this.area.append(this.here, this.cursor);
    this.driveButton = make("button", { type: "button", className: "whole", textContent: "Whole drive", hidden: true });
    this.driveButton.addEventListener("click", () => zoom(...range.drive));
    element.append(this.driveButton);
    this.tip = makeTip(element);
    this.area.setAttribute("tabindex", "0");
    this.listen(onFrame);
  }

  /** Point by the pointer and the keys, choose a part by dragging, and go to a frame by a click. */
  listen(onFrame) {
    const { area } = this;
    let begin = null;
    area.addEventListener("pointermove", (event) => {
      const x = this.at(event);
      pointAt(this, x);
      if (begin !== null) this.select(begin, x);
    });
    for (const end of ["pointerleave", "blur"]) area.addEventListener(end, () => pointAt(this, null));
    area.addEventListener("keydown", (event) => this.key(event, onFrame));
    if (!this.values.frames) return;
    area.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      begin = this.at(event);
      area.setPointerCapture(event.pointerId); // The reader may release the pointer beside the chart.
    });
    area.addEventListener("pointerup", (event) => {
      const end = this.at(event);
      const isDragged = begin !== null && Math.abs(end - begin) > (this.high - this.low) / 60;
      this.select(null);
      if (isDragged) zoom(Math.min(begin, end), Math.max(begin, end));
      else if (begin !== null) onFrame(Math.round(this.snapped(end)));
      begin = null;
    });
    area.addEventListener("pointercancel", () => {
      begin = null;
      this.select(null);
    });
  }

  /** Move the pointer by the arrow keys; Enter goes to a frame, Escape shows the whole drive. */
  key(event, onFrame) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step && this.values.frames && this.element.classList.contains("low")) return; // The browser of frames handles this key.
    const { numbers } = this;
    const place = this.pointed === undefined ? 0 : nearest(numbers, this.pointed);
    if (step) pointAt(this, numbers[Math.min(Math.max(place + step, 0), numbers.length - 1)]);
    else if (event.key === "Enter" && this.values.frames) onFrame(Math.round(numbers[place]));
    else if (event.key === "Escape" && this.values.frames) zoom(...range.drive);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** Return the place of a position in percent of the chart. */
  share(x) {
    const [first, last] = this.values.x;
    return (100 * (x - first)) / (last - first);
  }

  /** Return the position under the pointer. */
  at(event) {
    const box = this.area.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return this.low + share * (this.high - this.low);
  }

  /** Return the position with a value that is nearest to a position. */
  snapped(x) {
    return this.numbers[nearest(this.numbers, x)] ?? x;
  }

  /** Draw a line at the position with a value that is nearest to `x`; null removes the line. */
  point(x) {
    this.tip.hidden = true;
    this.cursor.removeAttribute("d");
    if (x === null) return;
    this.pointed = this.snapped(x);
    this.cursor.setAttribute("d", `M${this.share(this.pointed)} 0V100`);
  }

  /** Return the name of the position under the pointer. */
  where() {
    const { across, frames, names, unit } = this.values;
    if (frames) return `frame ${Math.round(this.pointed)}`;
    return across ? `${across} ${this.pointed.toFixed(2)} ${unit}` : names[Math.round(this.pointed)];
  }

  /** Return the place of a series' value at the position, or -1 if no value is near. */
  placeIn(series) {
    if (!series.x.length) return -1;
    const place = nearest(series.x, this.pointed);
    const near = this.values.across ? (this.high - this.low) / 50 : 0.5;
    const isFar = Math.abs(series.x[place] - this.pointed) > near;
    return isFar && !this.values.frames ? -1 : place;
  }

  /** Return the mark of a series from this figure's legend, or from a table of variants. */
  markOf(name) {
    const entries = [...(this.element.closest("figure")?.querySelectorAll(".legend li") ?? []), ...document.querySelectorAll(".with-dot")];
    return entries.find((entry) => entry.textContent.trim() === name)?.querySelector(".mark");
  }

  shownSeries() {
    return this.values.series.filter((series) => isShown(series.name));
  }

  /** Show the values at the position in a box. */
  tell() {
    const [shown, { unit, level }] = [this.shownSeries(), this.values];
    const lines = shown.map((series) => {
      const place = this.placeIn(series);
      const value = place < 0 ? null : series.y[place];
      const isOmitted = value === null && shown.length > 1 && (unit === "points" || !this.values.frames);
      return isOmitted ? null : tipLine(series.name, withEnds(value, series.low?.[place], series.high?.[place], unit), this.markOf(series.name));
    });
    if (level) lines.push(tipLine(level.name, withEnds(level.value, level.low, level.high, unit)));
    this.tip.replaceChildren(make("p", { className: "head", textContent: this.where() }), ...lines.filter(Boolean));
    this.tip.hidden = false;
    const share = (this.pointed - this.low) / (this.high - this.low);
    const [left, width] = [this.area.getBoundingClientRect().left - this.element.getBoundingClientRect().left, this.area.clientWidth];
    const best = left + share * width + (share > 0.6 ? -this.tip.offsetWidth - 10 : 10);
    this.tip.style.left = `${Math.max(0, Math.min(best, this.element.clientWidth - this.tip.offsetWidth))}px`;
  }

  /** Mark the part that the reader drags over; null removes the mark. */
  select(from, to) {
    this.chosen?.remove();
    if (from === null) return;
    const [left, right] = [from, to].map((x) => this.share(x)).sort((a, b) => a - b);
    this.chosen = svg("rect", { class: "chosen", x: left, y: 0, width: right - left, height: 100 });
    this.area.append(this.chosen);
  }

  /** Show a range of positions. */
  show(low, high) {
    [this.low, this.high] = [low, high];
    this.driveButton.hidden = !isPart();
    const [left, width] = [this.share(low), this.share(high) - this.share(low)];
    const [top, height] = this.fitValues();
    for (const point of this.element.querySelectorAll(".points > g > svg")) {
      point.setAttribute("x", `${(100 * (Number(point.dataset.x) - left)) / width}%`);
      point.setAttribute("y", `${(100 * (Number(point.dataset.y) - top)) / height}%`);
    }
    this.area.setAttribute("viewBox", `${left} ${top} ${width} ${height}`);
    const ticks = roundNumbers(low, high, Math.max(2, Math.min(8, this.area.clientWidth / 60)));
    this.element.querySelector(".xs").replaceChildren(
      ...ticks.map((tick) => {
        const place = (100 * (tick - low)) / (high - low);
        // The last number stays inside the chart.
        return svg("text", { x: `${place}%`, y: 14, ...(place > 97 ? { class: "last" } : {}) }, tick);
      }),
    );
  }

  /** Fit the axis of values to the shown values. Return the top of the view and its height in percent. */
  fitValues() {
    const { y: [first, last], series, frames } = this.values;
    const isWhole = this.low === this.values.x[0] && this.high === this.values.x[1];
    const shown = this.shownSeries();
    if (!frames || this.element.classList.contains("low") || (isWhole && shown.length === series.length)) return this.scale(first, last);
    const inside = shown.flatMap(({ x, y }) => y.filter((value, place) => value !== null && x[place] >= this.low && x[place] <= this.high));
    if (!inside.length) return this.scale(first, last);
    const room = Math.max(0.1, (Math.max(...inside) - Math.min(...inside)) * 0.08);
    return this.scale(first < 0 ? Math.min(...inside) - room : first, Math.min(last, Math.max(...inside) + room));
  }

  /** Draw the axis of values. Return the top of the view and its height in percent. */
  scale(bottom, top) {
    const [first, last] = this.values.y;
    const texts = roundNumbers(bottom, top, 5, 0).map((tick) => {
      const text = `${Number(tick.toFixed(6))}`.replace("-", "\u2212");
      return svg("text", { x: "100%", y: `${(100 * (top - tick)) / (top - bottom)}%` }, text);
    });
    if (!this.element.classList.contains("low")) this.element.querySelector(".ys").replaceChildren(...texts);
    return [(100 * (last - top)) / (last - first), (100 * (top - bottom)) / (last - first)];
  }

  /** Draw a line at the frame that the page shows. */
  mark(frame) {
    this.here.setAttribute("d", `M${this.share(frame)} 0V100`);
  }
}

/** Show the values at a position in this chart, and a line in all charts along the drive. */
function pointAt(view, x) {
  const views = view.values.frames ? driveCharts : [view];
  for (const other of views) other.point(x);
  if (x !== null) view.tell();
}

/** Return whether the reader has chosen a part of the drive. */
function isPart() {
  return range.drive && (range.low > range.drive[0] || range.high < range.drive[1]);
}

/** Show a part of the drive in all charts, unless it has no frame. */
function zoom(low, high) {
  const least = 3;
  if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
  if (range.frames && !range.frames.some((frame) => frame >= low && frame <= high)) return;
  [range.low, range.high] = [Math.max(low, range.drive[0]), Math.min(high, range.drive[1])];
  for (const view of driveCharts) view.show(range.low, range.high);
  for (const listener of range.onChange) listener();
}

/** Make all charts of the page interactive. */
function startCharts(onFrame) {
  for (const element of document.querySelectorAll(".chart")) {
    const view = new ChartView(element, onFrame);
    if (!view.values.frames) continue;
    driveCharts.push(view);
    range.drive ??= view.values.x;
    [range.low, range.high] = range.drive;
  }
  if (!driveCharts.length) return;
  const fit = () => {
    for (const view of driveCharts) view.show(view.low, view.high);
  };
  addEventListener("resize", fit);
  fit();
}
