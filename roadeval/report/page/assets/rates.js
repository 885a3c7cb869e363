// The page computes the rates of equations 24 to 29, overlaps and precision from counts of pixels: [TP, TN, FP, FN].

const share = (part, other) => (part + other ? part / (part + other) : NaN);
const RATES = {
  ACC: ([tp, tn, fp, fn]) => share(tp + tn, fp + fn),
  ERR: ([tp, tn, fp, fn]) => share(fp + fn, tp + tn),
  TPR: ([tp, , , fn]) => share(tp, fn),
  FNR: ([tp, , , fn]) => share(fn, tp),
  TNR: ([, tn, fp]) => share(tn, fp),
  FPR: ([, tn, fp]) => share(fp, tn),
  IoU: ([tp, , fp, fn]) => share(tp, fp + fn),
  mIoU: ([tp, tn, fp, fn]) => (share(tp, fp + fn) + share(tn, fp + fn)) / 2,
  F1: ([tp, , fp, fn]) => share(2 * tp, fp + fn),
  precision: ([tp, , fp]) => share(tp, fp),
};
const POOLED = ["IoU", "mIoU", "F1", "precision"]; // Tables state these rates for all pixels together.

/** Return the mean of a rate over the frames on which it is defined. */
function meanRate(name, counts) {
  const defined = counts.map(RATES[name]).filter((rate) => !Number.isNaN(rate));
  return defined.reduce((sum, rate) => sum + rate, 0) / defined.length;
}

/** Return the sums of the counts of frames. */
const addCounts = (counts) => [0, 1, 2, 3].map((place) => counts.reduce((sum, frame) => sum + frame[place], 0));

/** Return the rate that a column's title names, for some frames; undefined if the title names no rate. */
function rateOfColumn(title, counts) {
  const pooled = title.startsWith("pooled ") ? title.slice(7) : POOLED.includes(title) ? title : null;
  if (pooled in RATES) return RATES[pooled](addCounts(counts));
  return title in RATES ? meanRate(title, counts) : undefined;
}

/** Return a rate in percent, as all tables write it. */
const percent = (rate, digits = 2) => (Number.isNaN(rate) ? "\u2013" : (100 * rate).toFixed(digits));

/** Return a caption in which values replace the words in braces. */
const fill = (words, values) => words.replace(/{(\w+)}/g, (_, name) => values[name]);
