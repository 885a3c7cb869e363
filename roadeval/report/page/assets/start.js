// The page is complete without a script; this makes it interactive.

/** Give each command a button that copies it, if the browser allows it. */
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

/** Open the contents beside the page, and close them if they are above it. */
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
for (const long of document.querySelectorAll(".long")) makeSearchable(long);
makeCommands();
const element = document.querySelector(".browser");
let browser = null;
startCharts((frame) => browser?.show(nearestFrame(frame)));
startPlaces();
if (element) browser = new Browser(element);
fitOutline();
followOutline();

/** The frame of the table that is nearest to a number. */
function nearestFrame(frame) {
  const frames = browser.shown();
  return frames[nearest(frames, frame)] ?? frame;
}

for (const image of document.querySelectorAll(".grid img")) {
  image.addEventListener("click", () => enlargePicture(image));
}
// A closed chart had no width to fit its numbers into.
for (const more of document.querySelectorAll("details")) more.addEventListener("toggle", () => dispatchEvent(new Event("resize")));
