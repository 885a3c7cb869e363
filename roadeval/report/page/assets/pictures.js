// Pictures that enlarge, and a slider between two of them.

const dialog = document.querySelector("dialog.large");
let onClosed = null;

/** Show something over the page until it is closed. */
function enlarge(content, closed = null) {
  const inside = document.createElement("div");
  inside.className = "inside";
  const button = document.createElement("button");
  button.type = "button";
  button.className = "closing";
  button.textContent = "Close";
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

function enlargePicture(image) {
  const large = document.createElement("img");
  [large.src, large.alt] = [image.src, image.alt];
  const words = document.createElement("p");
  words.className = "note";
  words.textContent = image.alt;
  enlarge([large, words]);
}

/** Two pictures of a frame over each other: one to the left of the slider, one to the right. */
class Stage {
  constructor(element, left, right) {
    this.element = element;
    this.home = element.parentElement;
    this.next = element.nextElementSibling;
    this.above = element.querySelector(".above");
    this.below = element.querySelector(".below");
    this.edge = element.querySelector(".edge");
    this.slider = element.querySelector("input");
    this.selects = [element.querySelector(".left"), element.querySelector(".right")];
    this.chosen = [left, right];
    this.slider.addEventListener("input", () => this.slide());
    for (const [side, select] of this.selects.entries()) {
      select.addEventListener("change", () => {
        this.chosen[side] = select.value;
        this.draw();
      });
    }
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

  /** Offer the pictures of a frame; the choice of pictures stays, if the frame has them. */
  offer(tiles) {
    this.tiles = new Map(tiles.map((tile) => [tile.dataset.name, tile]));
    for (const [side, select] of this.selects.entries()) {
      select.replaceChildren(...[...this.tiles.keys()].map((name) => new Option(name, name)));
      const name = this.tiles.has(this.chosen[side]) ? this.chosen[side] : [...this.tiles.keys()][0];
      select.value = name;
    }
    this.element.hidden = !tiles.length;
    if (tiles.length) this.draw();
  }

  /** Look at two variants, or at one. */
  prefer(variants) {
    const names = [...this.tiles.keys()];
    for (const [side, variant] of variants.entries()) {
      const pictures = names.filter((name) => name.startsWith(`${variant}: `));
      this.chosen[side] = pictures.find((name) => name.endsWith(": errors")) ?? pictures.at(-1) ?? this.chosen[side];
    }
    this.offer([...this.tiles.values()]);
  }

  /** Look at one picture alone. */
  choose(name) {
    this.chosen[0] = name;
    this.selects[0].value = name;
    this.slide(100);
    this.draw();
  }

  draw() {
    const [left, right] = this.selects.map((select) => this.tiles.get(select.value));
    for (const [view, tile] of [[this.above, left], [this.below, right]]) {
      const image = tile.querySelector("img");
      [view.src, view.alt] = [image.src, image.alt];
    }
    for (const tile of this.tiles.values()) {
      if (tile === left || tile === right) tile.setAttribute("aria-current", "true");
      else tile.removeAttribute("aria-current");
    }
    this.slide();
  }

  slide(share = Number(this.slider.value)) {
    const percent = Math.min(100, Math.max(0, share));
    this.slider.value = percent;
    this.above.style.clipPath = `inset(0 ${100 - percent}% 0 0)`;
    this.edge.style.left = `${percent}%`;
    this.edge.hidden = percent <= 0 || percent >= 100;
  }

  toggle() {
    if (dialog.open) dialog.close();
    else enlarge([this.element], () => this.home.insertBefore(this.element, this.next));
  }
}
