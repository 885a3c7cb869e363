// These scripts make the page interactive. It is complete without them.

/** Give each command a button that copies it, if the browser allows that. */
function makeCommands() {
  if (!navigator.clipboard) return;
  for (const command of document.querySelectorAll(".command")) {
    const button = make("button", { type: "button", textContent: "Copy" });
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(command.querySelector("code").textContent);
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
    command.append(button);
  }
}

/** Open the list of contents if it stands beside the page, and close it if it stands above. */
function fitOutline() {
  const wide = matchMedia("(min-width: 1100px)");
  const fit = () => (document.querySelector(".outline details").open = wide.matches);
  wide.addEventListener("change", fit);
  fit();
}

/** Mark the current section in the contents. */
function followOutline() {
  const links = new Map([...document.querySelectorAll(".outline a")].map((a) => [a.hash.slice(1), a]));
  const titles = [...links.keys()].map((name) => document.getElementById(name)).filter(Boolean);
  const follow = () => {
    const above = titles.filter((title) => title.getBoundingClientRect().top < innerHeight / 3);
    const current = above.at(-1) ?? titles[0];
    for (const [name, link] of links) {
      if (name === current?.id) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
  };
  addEventListener("scroll", follow, { passive: true });
  follow();
}

document.documentElement.classList.add("scripted-on");
for (const table of document.querySelectorAll("table")) makeSortable(table);
for (const part of document.querySelectorAll(".long")) makeSearchable(part);
makeCommands();
const element = document.querySelector(".browser");
let browser = null;
startCharts((frame) => browser?.show(nearestFrame(frame)));
startPlaces();
if (element) browser = new Browser(element);
fitOutline();
followOutline();

/** Return the shown frame that is nearest to a number. */
function nearestFrame(frame) {
  const frames = browser.shown();
  return frames[nearest(frames, frame)] ?? frame;
}

for (const image of document.querySelectorAll(".grid img")) {
  image.addEventListener("click", () => enlargePicture(image));
}
// A closed chart has no width, so its numbers are fitted when it opens.
for (const details of document.querySelectorAll("details")) details.addEventListener("toggle", () => dispatchEvent(new Event("resize")));
