// The reader chooses the focus, the variant beside it, and a part of the drive. The address keeps these choices.

const choice = { focus: "", beside: "" };

/** Return whether a part of the page is shown. A part that belongs to no variant is always shown. */
function isShown(name) {
  const form = document.querySelector(".choice");
  if (!choice.beside || !form || !name) return true;
  const variants = [...form.elements.focus.options].map((option) => option.value);
  const variant = variants.find((start) => name === start || name.startsWith(`${start}: `));
  return !variant || variant === choice.focus || variant === choice.beside;
}

/** Return what the address names: a frame or a section, and then the choices. */
function readAddress() {
  const [place, ...pairs] = location.hash.slice(1).split("&");
  const frame = /^frame-(\d+)$/.exec(place);
  return { place, frame: frame ? Number(frame[1]) : null, ...Object.fromEntries(new URLSearchParams(pairs.join("&"))) };
}

/** Write a frame and the choices into the address. The history gets a new step, or its last step is replaced. */
function writeAddress(frame, choices, step = "replaceState") {
  const pairs = Object.entries(choices).filter(([, value]) => value).map(([name, value]) => `&${name}=${encodeURIComponent(value)}`);
  const hash = `#frame-${frame}${pairs.join("")}`;
  if (location.hash !== hash) history[step](null, "", hash);
}

/** Set the focus, and call a function after each change of the form. */
function startChoice(focus, onChange) {
  const form = document.querySelector(".choice");
  choice.focus = focus;
  if (!form) return;
  form.hidden = false;
  form.elements.focus.value = focus;
  form.addEventListener("change", () => choose(form.elements.focus.value, form.elements.beside.value, onChange));
}

/** Show a focus, and beside it all variants, one variant, or none. */
function choose(focus, beside, onChange) {
  const form = document.querySelector(".choice");
  [choice.focus, choice.beside] = [focus, beside];
  if (form) [form.elements.focus.value, form.elements.beside.value] = [focus, beside];
  for (const part of document.querySelectorAll("[data-of]")) part.toggleAttribute("hidden", !isShown(part.dataset.of));
  onChange();
}
