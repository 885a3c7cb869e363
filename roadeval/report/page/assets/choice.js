// The choices on a page: its focus, the variant beside it, the part of the drive. The address keeps them.

const choice = { focus: "", beside: "" };

/** Whether a part of this name is shown: parts that belong to no variant always are. */
function isShown(name) {
  const form = document.querySelector(".choice");
  if (!choice.beside || !form || !name) return true;
  const variants = [...form.elements.focus.options].map((option) => option.value);
  const variant = variants.find((start) => name === start || name.startsWith(`${start}: `));
  return !variant || variant === choice.focus || variant === choice.beside;
}

/** What the address names: a frame or a section, and the choices behind it. */
function readAddress() {
  const [place, ...pairs] = location.hash.slice(1).split("&");
  const frame = /^frame-(\d+)$/.exec(place);
  return { place, frame: frame ? Number(frame[1]) : null, ...Object.fromEntries(new URLSearchParams(pairs.join("&"))) };
}

/** Name a frame and the choices in the address, as a new step of the history or in place of the last. */
function writeAddress(frame, choices, step = "replaceState") {
  const pairs = Object.entries(choices).filter(([, value]) => value).map(([name, value]) => `&${name}=${encodeURIComponent(value)}`);
  const hash = `#frame-${frame}${pairs.join("")}`;
  if (location.hash !== hash) history[step](null, "", hash);
}

function startChoice(focus, onChange) {
  const form = document.querySelector(".choice");
  choice.focus = focus;
  if (!form) return;
  form.hidden = false;
  form.elements.focus.value = focus;
  form.addEventListener("change", () => choose(form.elements.focus.value, form.elements.beside.value, onChange));
}

/** Show a focus, with all variants, or with one or none beside it. */
function choose(focus, beside, onChange) {
  const form = document.querySelector(".choice");
  [choice.focus, choice.beside] = [focus, beside];
  if (form) [form.elements.focus.value, form.elements.beside.value] = [focus, beside];
  for (const part of document.querySelectorAll("[data-of]")) part.toggleAttribute("hidden", !isShown(part.dataset.of));
  onChange();
}
