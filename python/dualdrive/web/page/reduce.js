// Series that are here in full (a saved report): the same reduction that the server does.

// times, columns: arrays of one length. Least and greatest value of every pixel of start .. stop.
export function reduced(times, columns, start, stop, pixels) {
  const first = Math.max(below(times, start) - 1, 0);
  const last = Math.min(below(times, stop) + 1, times.length);
  if (last - first <= 2 * pixels) {
    return { t: times.slice(first, last), values: columns.map((y) => y.slice(first, last)), exact: true };
  }
  const t = new Float64Array(2 * pixels);
  const values = columns.map(() => new Float64Array(2 * pixels).fill(NaN));
  const width = (stop - start) / pixels;
  let from = first;
  for (let k = 0; k < pixels; k++) {
    t[2 * k] = start + (k + 0.25) * width;
    t[2 * k + 1] = start + (k + 0.75) * width;
    const to = k === pixels - 1 ? last : Math.max(from, below(times, start + (k + 1) * width));
    columns.forEach((y, n) => {
      let low = Infinity, high = -Infinity;
      for (let i = from; i < to; i++) {
        if (y[i] < low) low = y[i];
        if (y[i] > high) high = y[i];
      }
      if (to > from) {
        values[n][2 * k] = low;
        values[n][2 * k + 1] = high;
      }
    });
    from = to;
  }
  return { t, values, exact: false };
}

// The number of times before `at`.
export function below(times, at) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < at) low = middle + 1;
    else high = middle;
  }
  return low;
}

export function nearest(times, at) {
  const k = below(times, at);
  if (k === 0) return 0;
  return k === times.length || at - times[k - 1] < times[k] - at ? k - 1 : k;
}
