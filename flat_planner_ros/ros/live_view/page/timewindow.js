// The time that the plots show: the newest seconds, or a window that stands still.

const SHORTEST = 0.1;   // [s]
const LONGEST = 600;    // [s]
const LEAST = 0.5;      // share of the window in which something is to be seen

export class TimeWindow {
  constructor(span) {
    this.span = span;
    this.end = null;      // null: the newest
    this.stood = 0;       // the newest time when it came to stand
    this.newest = 0;
    this.oldest = 0;
    this.cursor = null;   // share of the width, null without one
  }

  get isLive() { return this.end === null; }

  get to() { return this.end ?? this.newest; }

  get from() { return this.to - this.span; }

  // The time that is pointed at, or the last one.
  get instant() { return this.cursor === null ? this.to : this.from + this.cursor * this.span; }

  follow(oldest, newest) { [this.oldest, this.newest] = [oldest, newest]; }

  stand() { this.standAt(this.to); }

  live() { this.end = null; }

  // Show more or less; the time at a share of the width stays where it is, unless the window moves.
  zoom(factor, share = 1) {
    const before = this.span;
    this.span = Math.min(LONGEST, Math.max(SHORTEST, factor * before));
    if (!this.isLive) this.move((1 - share) * (this.span - before));
  }

  // Go back or forward [s]; who comes to the newest moves with it.
  move(seconds) {
    const earliest = Math.min(this.newest, this.oldest + LEAST * this.span);
    const end = Math.max(earliest, this.to + seconds);
    if (end < this.newest) this.standAt(end); else this.live();
  }

  standAt(end) {
    if (this.isLive) this.stood = this.newest;
    this.end = end;
  }
}
