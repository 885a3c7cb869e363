// The video of a drive. Each of its pictures holds the camera image, the truth and the masks of one frame.

const DARKEN = 0.75; // An overlay leaves this share of the camera's brightness, as in other pictures.
const [TN, TP, FP, FN, IGNORED] = [0, 1, 2, 3, 4];

class Film {
  constructor(source, facts, colours, onFrame) {
    Object.assign(this, facts);
    this.colours = colours;
    this.places = new Map(facts.frames.map((frame, place) => [frame, place]));
    this.levels = {}; // If the reader moved a variant's threshold, it is here in levels of the probability.
    const height = Math.ceil(facts.panels.length / facts.columns) * facts.height;
    const canvas = make("canvas", { width: facts.columns * facts.width, height });
    this.mosaic = canvas.getContext("2d", { willReadFrequently: true });
    this.video = make("video", { muted: true, preload: "auto", playsInline: true, src: source });
    this.video.addEventListener("seeked", () => this.seeked());
    this.video.addEventListener("loadeddata", () => this.seeked());
    this.onFrame = onFrame;
  }

  /** Return the names of the pictures that can be painted. */
  pictures() {
    const scored = this.panels.includes("truth");
    return this.panels.flatMap((name) => (scored && name.endsWith(": mask") ? [name.replace(": mask", ": errors"), name] : [name]));
  }

  /** Go to a frame's picture. If several requests wait, only the last one is served. */
  seek(frame) {
    const place = this.places.get(frame);
    if (place === undefined) return;
    this.target = place;
    if (!this.video.seeking && this.video.readyState >= 2) this.video.currentTime = (place + 0.5) / this.fps;
  }

  /** Take the picture that the video has reached, or go on to the requested one. */
  seeked() {
    if (this.playing) return;
    const time = ((this.target ?? 0) + 0.5) / this.fps;
    if (Math.abs(this.video.currentTime - time) > 0.4 / this.fps) this.video.currentTime = time;
    else this.take();
  }

  /** Take the current picture of the video. */
  take() {
    this.mosaic.drawImage(this.video, 0, 0);
    this.cache = new Map();
    this.onFrame(this.frames[this.target]);
  }

  /** Play until a frame, or until the end. */
  async play(last, onEnd) {
    this.playing = true;
    await this.video.play().catch(() => {}); // A pause before the video begins is no error.
    const step = () => {
      const place = Math.min(Math.floor(this.video.currentTime * this.fps), this.frames.length - 1);
      if (place !== this.target) {
        this.target = place;
        this.take();
      }
      if (!this.video.paused && !this.video.ended && this.frames[place] < last) requestAnimationFrame(step);
      else {
        this.pause();
        onEnd();
      }
    };
    step();
  }

  pause() {
    this.video.pause();
    this.playing = false;
  }

  /** Return the pixels of a panel, (H, W) RGBA. */
  panel(name) {
    if (!this.cache.has(name)) {
      const place = this.panels.indexOf(name);
      const [left, top] = [(place % this.columns) * this.width, Math.floor(place / this.columns) * this.height];
      this.cache.set(name, this.mosaic.getImageData(left, top, this.width, this.height).data);
    }
    return this.cache.get(name);
  }

  /** Return a panel of a variant, and the level from which its pixels are road.
   *
   * The panel is the mask, or the probability of road if the reader moved the threshold. */
  road(variant) {
    const level = this.levels[variant];
    const moved = level !== undefined && this.panels.includes(`${variant}: probability`);
    return [this.panel(`${variant}: ${moved ? "probability" : "mask"}`), moved ? level : 128];
  }

  /** Paint a picture on a canvas: the camera image, or classes of pixels over the darkened camera image. */
  paint(canvas, name) {
    if (!this.cache) return;
    const [camera, [variant, kind]] = [this.panel("camera"), name.split(/: (?=\w+$)/)];
    const image = new ImageData(this.width, this.height);
    const isPlain = name === "camera" || kind === "probability";
    image.data.set(isPlain ? this.panel(name) : camera);
    if (!isPlain) {
      const truth = this.panels.includes("truth") ? this.panel("truth") : null;
      const [mask, level] = kind ? this.road(variant) : [truth, 192];
      const tints = this.colours.map(([r, g, b, a]) => [r, g, b].map((value) => (value * a) / 255).concat(DARKEN * (1 - a / 255)));
      for (let at = 0; at < mask.length; at += 4) {
        const [road, label] = [mask[at] >= level, truth ? truth[at] : 0];
        let outcome = road ? TP : TN;
        if (truth && label > 63 && label < 192) outcome = kind === "mask" ? outcome : IGNORED;
        else if (kind === "errors" && label >= 192) outcome = road ? TP : FN;
        else if (kind === "errors") outcome = road ? FP : TN;
        const tint = tints[outcome];
        for (let c = 0; c < 3; c++) image.data[at + c] = tint[c] + tint[3] * camera[at + c];
      }
    }
    [canvas.width, canvas.height] = [this.width, this.height];
    canvas.getContext("2d").putImageData(image, 0, 0);
  }
}
