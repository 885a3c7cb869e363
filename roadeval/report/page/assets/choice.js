// Two variants for the page: parts that belong to other variants are hidden.

let chosen = [];

/** Whether a part of this name is shown: parts that belong to no variant always are. */
function isShown(name) {
  const form = document.querySelector(".choice");
  if (!chosen.length || !form || !name) return true;
  const variants = [...form.querySelector("select").options].map((option) => option.value).filter(Boolean);
  const variant = variants.find((start) => name === start || name.startsWith(`${start}: `));
  return !variant || chosen.includes(variant);
}

function startChoice(onChange) {
  const form = document.querySelector(".choice");
  if (!form) return;
  const [one, other] = form.querySelectorAll("select");
  form.hidden = false;
  form.addEventListener("change", () => {
    other.disabled = !one.value;
    if (!one.value) other.value = "";
    chosen = [one.value, other.value].filter(Boolean);
    for (const part of document.querySelectorAll("[data-of]")) part.toggleAttribute("hidden", !isShown(part.dataset.of));
    onChange();
  });
}
