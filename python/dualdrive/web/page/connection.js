// The server: its state as it changes, commands, files, series. Addresses are relative to the page,
// whose own address carries the token.

export class Connection extends EventTarget {
  constructor() {
    super();
    this.state = null;
    this.views = new Map();
    this.open();
  }

  open() {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    const socket = new WebSocket(address);
    socket.onmessage = (event) => this.take(JSON.parse(event.data));
    socket.onopen = () => {
      this.fresh = true; // perhaps another server, which counts anew
      this.told("online");
    };
    socket.onclose = () => {
      this.told("offline");
      setTimeout(() => this.open(), 1000);
    };
  }

  // Answers of commands and of the socket overtake one another: the latest stands.
  take(state) {
    if (this.state && state.turn < this.state.turn && !this.fresh) return;
    this.fresh = false;
    this.state = state;
    this.told("state");
  }

  told(what, detail = null) {
    this.dispatchEvent(new CustomEvent(what, { detail }));
  }

  async do(command, told = {}) {
    return this.answered(await this.ask(`do/${command}`, told));
  }

  async upload(file) {
    const limit = 1e9;
    if (file.size > limit) {
      this.told("refused", `${file.name}: more than 1 GB; record less, or decimate it first`);
      return null;
    }
    const answer = await fetch(`upload/${encodeURIComponent(file.name)}`, { method: "PUT", body: file }).catch(() => null);
    return this.answered(answer);
  }

  // Refusals are told in the server's words.
  async answered(answer) {
    if (answer?.ok) {
      const state = await answer.json();
      this.take(state);
      return state;
    }
    const told = await answer?.json().catch(() => null);
    this.told("refused", told?.refused ?? "the server does not answer; is it still running?");
    return null;
  }

  ask(where, told) {
    return fetch(where, { method: "POST", body: JSON.stringify(told) }).catch(() => null);
  }

  async series(told) {
    const answer = await this.ask("series", told);
    if (!answer?.ok) throw new Error((await answer?.json().catch(() => null))?.refused ?? "the server does not answer");
    return answer.arrayBuffer();
  }

  async values(told) {
    const answer = await this.ask("values", told);
    return answer?.ok ? answer.json() : [];
  }

  // A result by its job; it never changes, so it is asked for once.
  view(job) {
    if (!this.views.has(job)) {
      this.views.set(job, fetch(`view/${job}`).then((answer) => (answer.ok ? answer.json() : null)).catch(() => null));
    }
    return this.views.get(job);
  }

  async presets() {
    const answer = await fetch("state");
    return (await answer.json()).presets;
  }
}
