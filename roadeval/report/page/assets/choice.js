// Two variants for the whole page: what belongs to others alone is hidden.

let chosen = [];

/** Whether what has a name is seen: what is of no variant always is. */
function isShown(name) {
  const form = document.querySelector(".choice");
  if (!chosen.length || !form || !name) return true;
  const known = [...form.querySelector("select").options].map((each) => each.value).filter(Boolean);
  const own = known.find((each) => name === each || name.startsWith(`${each}: `));
  return !own || chosen.includes(own);
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
    for (const each of document.querySelectorAll("[data-of]")) each.toggleAttribute("hidden", !isShown(each.dataset.of));
    onChange();
  });
}
