// The rates of equations 24 to 29, overlaps and precision, from counts of pixels [TP, TN, FP, FN].

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
const POOLED = ["IoU", "mIoU", "F1", "precision"]; // Tables state these of all pixels together.

/** The mean of the frames on which a rate is defined. */
function meanRate(name, counts) {
  const defined = counts.map(RATES[name]).filter((rate) => !Number.isNaN(rate));
  return defined.reduce((sum, rate) => sum + rate, 0) / defined.length;
}

const addCounts = (counts) => [0, 1, 2, 3].map((place) => counts.reduce((sum, frame) => sum + frame[place], 0));

/** The rate that a column's title names, of some frames; undefined for other titles. */
function rateOfColumn(title, counts) {
  const pooled = title.startsWith("pooled ") ? title.slice(7) : POOLED.includes(title) ? title : null;
  if (pooled in RATES) return RATES[pooled](addCounts(counts));
  return title in RATES ? meanRate(title, counts) : undefined;
}

/** A rate in percent, as in all tables. */
const percent = (rate, digits = 2) => (Number.isNaN(rate) ? "\u2013" : (100 * rate).toFixed(digits));

/** A caption with values in place of the words in braces. */
const fill = (words, values) => words.replace(/{(\w+)}/g, (_, name) => values[name]);
