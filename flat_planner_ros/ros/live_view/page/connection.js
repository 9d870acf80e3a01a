// The websocket: news come in, commands go out, and a lost connection is taken up again.

const PATIENCE = {shortest: 500, longest: 5000};  // [ms] between two tries to connect

export class Connection {
  constructor({begin, hear}) {
    this.begin = begin;
    this.hear = hear;
    this.number = 0;
    this.waiting = new Map();
    this.wait = PATIENCE.shortest;
    this.open();
  }

  get isOpen() { return this.socket.readyState === WebSocket.OPEN; }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/ws`);
    this.socket.onopen = () => { this.wait = PATIENCE.shortest; this.begin(); };
    this.socket.onmessage = event => this.take(JSON.parse(event.data));
    this.socket.onclose = () => {
      for (const finish of this.waiting.values()) finish({ok: false, text: 'the connection is lost'});
      this.waiting.clear();
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, PATIENCE.longest);
    };
  }

  take(news) {
    if (news.reply) {
      this.waiting.get(news.reply.id)?.(news.reply);
      this.waiting.delete(news.reply.id);
    }
    this.hear(news);
  }

  // Return a promise of {ok, text}.
  send(command) {
    return new Promise(finish => {
      if (!this.isOpen) return finish({ok: false, text: 'not connected'});
      this.number += 1;
      this.waiting.set(this.number, finish);
      this.socket.send(JSON.stringify({...command, id: this.number}));
    });
  }
}
