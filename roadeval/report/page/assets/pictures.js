// A click enlarges a picture. A slider compares two pictures of the film.

const dialog = document.querySelector("dialog.large");
let onClosed = null;

/** Show elements over the page until the reader closes them. */
function enlarge(content, closed = null) {
  const inside = make("div", { className: "inside" });
  const button = make("button", { type: "button", className: "closing", textContent: "Close" });
  button.addEventListener("click", () => dialog.close());
  inside.append(button, ...content);
  dialog.replaceChildren(inside);
  onClosed = closed;
  if (!dialog.open) dialog.showModal();
}

dialog.addEventListener("close", () => {
  onClosed?.();
  onClosed = null;
});
dialog.addEventListener("click", (event) => {
  if (event.target === dialog) dialog.close();
});

/** Show a picture over the page, with its title. */
function enlargePicture({ src, alt }) {
  enlarge([make("img", { src, alt }), make("p", { className: "note", textContent: alt })]);
}

/** Two pictures of the film that cover each other: one shows to the left of the slider, one to the right. */
class Stage {
  constructor(element, film) {
    this.element = element;
    this.film = film;
    this.home = element.parentElement;
    this.next = element.nextElementSibling;
    const parts = [".above", ".below", ".edge", "input"].map((name) => element.querySelector(name));
    [this.above, this.below, this.edge, this.slider] = parts;
    this.selects = [element.querySelector(".left"), element.querySelector(".right")];
    this.slider.addEventListener("input", () => this.slide());
    for (const select of this.selects) {
      select.append(...film.pictures().map((name) => new Option(name, name)));
      select.addEventListener("change", () => this.draw());
    }
    element.hidden = false;
    const views = element.querySelector(".views");
    let dragged = false;
    views.addEventListener("pointerdown", (event) => {
      dragged = false;
      if (event.pointerType === "mouse" && event.button !== 0) return;
      const move = (moved) => {
        if (Math.abs(moved.clientX - event.clientX) > 4) dragged = true;
        const box = views.getBoundingClientRect();
        if (dragged) this.slide((100 * (moved.clientX - box.left)) / box.width);
      };
      const end = () => removeEventListener("pointermove", move);
      addEventListener("pointermove", move);
      addEventListener("pointerup", end, { once: true });
      addEventListener("pointercancel", end, { once: true });
      event.preventDefault();
    });
    views.addEventListener("click", () => {
      if (!dragged) this.toggle();
    });
  }

  /** Show two variants. The camera replaces a variant that has no masks. */
  prefer(variants) {
    const names = this.film.pictures();
    for (const [side, variant] of variants.entries()) {
      this.selects[side].value = names.find((name) => name.startsWith(`${variant}: `)) ?? "camera";
    }
    this.draw();
  }

  /** Paint both pictures. */
  draw() {
    for (const [side, view] of [this.above, this.below].entries()) {
      const name = this.selects[side].value;
      view.setAttribute("aria-label", name);
      this.film.paint(view, name);
    }
    this.slide();
  }

  /** Show a share of the left picture, in percent. */
  slide(share = Number(this.slider.value)) {
    const percent = Math.min(100, Math.max(0, share));
    this.slider.value = percent;
    this.above.style.clipPath = `inset(0 ${100 - percent}% 0 0)`;
    this.edge.style.left = `${percent}%`;
    this.edge.hidden = percent <= 0 || percent >= 100;
  }

  /** Enlarge the pictures, or close the enlarged pictures. */
  toggle() {
    if (dialog.open) dialog.close();
    else enlarge([this.element], () => this.home.insertBefore(this.element, this.next));
  }
}
