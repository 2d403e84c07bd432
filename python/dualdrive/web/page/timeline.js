// What all panels share: the stretch of time that is shown, and two cursors.

export class Timeline extends EventTarget {
  constructor() {
    super();
    this.full = [0, 1];
    this.range = [0, 1];
    this.cursors = { a: null, b: null };
    this.hover = null;
  }

  // The whole stretch there is; what is shown stays where it still fits.
  span(start, stop) {
    const whole = this.range[0] === this.full[0] && this.range[1] === this.full[1];
    this.full = [start, stop > start ? stop : start + 1];
    if (whole || this.range[1] <= start || this.range[0] >= stop) this.show(...this.full);
    else this.show(...this.range);
  }

  show(start, stop) {
    const [low, high] = this.full;
    const least = (high - low) * 1e-7;
    let width = Math.min(Math.max(stop - start, least), high - low);
    let begin = Math.min(Math.max(start, low), high - width);
    this.range = [begin, begin + width];
    this.dispatchEvent(new Event("range"));
  }

  pan(share) {
    const [a, b] = this.range;
    this.show(a + share * (b - a), b + share * (b - a));
  }

  zoom(factor, about = null) {
    const [a, b] = this.range;
    const at = about ?? (this.cursors.a !== null && this.cursors.a >= a && this.cursors.a <= b ? this.cursors.a : (a + b) / 2);
    this.show(at - (at - a) * factor, at + (b - at) * factor);
  }

  all() {
    this.show(...this.full);
  }

  put(which, at, spoken = false) {
    this.cursors[which] = at === null ? null : Math.min(Math.max(at, this.full[0]), this.full[1]);
    this.dispatchEvent(new CustomEvent("cursor", { detail: { spoken } }));
  }

  // Cursor steps by a share of what is shown; what is shown follows it.
  step(which, share) {
    const [a, b] = this.range;
    const at = (this.cursors[which] ?? (share > 0 ? a : b)) + share * (b - a);
    this.put(which, at, true);
    if (at < a || at > b) this.pan(at < a ? -0.5 : 0.5);
  }
}
